#include "tokens.h"

const struct record *tokens_find(const struct tokens *tokens, uint64_t token) {
    for (size_t i = 0; i < tokens->size; i++) {
        if (tokens->records[i].token == token) {
            return &tokens->records[i];
        }
    }
    return NULL;
}

struct record tokens_absent(const struct tokens *tokens, uint64_t token) {
    struct record record = {.token = token, .fate = FATE_NEVER_ARMED};
    if (token <= tokens->dropped_up_to) {
        record.fate = FATE_UNKNOWN;
    }
    return record;
}

void tokens_keep(struct tokens *tokens, const struct record *record) {
    if (tokens->size < HISTORY) {
        tokens->size++;
    } else if (tokens->records[tokens->next].token > tokens->dropped_up_to) {
        tokens->dropped_up_to = tokens->records[tokens->next].token;
    }
    tokens->records[tokens->next] = *record;
    tokens->next = (tokens->next + 1U) % HISTORY;
}

/* The memory behind exactly-once: what became of each token of this power cycle. */
#ifndef TOKENS_H
#define TOKENS_H

#include "limits.h"

#include <stddef.h>
#include <stdint.h>

/* By their numbers on the wire. */
enum fate {
    FATE_UNKNOWN = 0,
    FATE_NEVER_ARMED = 1,
    FATE_ARMED = 2,
    FATE_FIRED = 3,
    FATE_EXPIRED = 4,
    FATE_ABORTED = 5,
};

struct record {
    uint64_t token;
    uint64_t start_us; /* 0 unless it fired, and the levels too */
    uint32_t left_mvpp;
    uint32_t right_mvpp;
    enum fate fate;
};

/* The danger is not to forget but to say "never armed" of what was forgotten: a burst that was felt
 * would be presented again. Up to the largest token ever dropped absence means nothing; hosts count
 * upwards, so that what they ask for lies above it. */
struct tokens {
    struct record records[HISTORY];
    size_t size;
    size_t next;
    uint64_t dropped_up_to;
};

/* Return the record of a token, or NULL. */
const struct record *tokens_find(const struct tokens *tokens, uint64_t token);

/* Return what can be said of a token that has no record. */
struct record tokens_absent(const struct tokens *tokens, uint64_t token);

/* Add the record of a token that has none, dropping the oldest if the memory is full. */
void tokens_keep(struct tokens *tokens, const struct record *record);

#endif

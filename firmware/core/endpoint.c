#include "endpoint.h"

#include <assert.h>
#include <string.h>

enum kind {
    HELLO = 0x01,
    PING = 0x02,
    LIMITS = 0x03,
    HEALTH = 0x04,
    BEGIN = 0x10,
    DATA = 0x11,
    COMMIT = 0x12,
    LEVEL = 0x20,
    OUTPUT = 0x21,
    ARM = 0x22,
    DISARM = 0x23,
    FIRE = 0x24,
    QUERY = 0x25,
    MEASURED = 0x26,
    STOP = 0x30,
    BEAT = 0x31,
};

#define BOOT_ID_SIZE 8U
#define LINE_SIZE (9U + 1U + NAME_SIZE + 1U + NAME_SIZE + 1U + 12U + 1U)
static_assert(LINE_SIZE <= LONGEST_ANSWER, "the line of *IDN? has room where an answer has");
static_assert(VERSION < 10U && MINOR < 10U, "that line has a digit for each");

void endpoint_init(struct endpoint *endpoint, const struct about *about) {
    endpoint->about = *about;
    decoder_reset(&endpoint->decoder);
    device_init(&endpoint->device, about->boot_id, about->sample_rate_mhz);
}

void endpoint_hang_up(struct endpoint *endpoint, uint64_t now_us) {
    device_advance(&endpoint->device, now_us);
    device_stop(&endpoint->device);
    decoder_reset(&endpoint->decoder);
    endpoint->upload.is_under_way = false;
}

/* --- answers: the head, and what follows it */

static uint8_t *write_text(uint8_t *at, const char *text, size_t size) {
    memcpy(at, text, size);
    return at + size;
}

static uint8_t *write_greeting(uint8_t *at, const struct about *about, uint64_t nonce) {
    at = write_u8(write_u8(write_u64(at, nonce), MINOR), about->emulated ? 1U : 0U);
    at = write_u8(write_u8(at, BITS), CHANNELS);
    at = write_u32(write_u32(at, about->sample_rate_mhz), CEILING_MVPP);
    at = write_u32(at, LONGEST_WAVEFORM);
    at = write_text(at, about->model, NAME_SIZE);
    return write_text(at, about->serial_number, NAME_SIZE);
}

static uint8_t *write_limits(uint8_t *at, const struct about *about) {
    at = write_u32(write_u8(at, SLOTS), MEMORY_SAMPLES);
    at = write_u32(write_u32(at, LEAST_INTERVAL_US), MAX_DUTY_PPM);
    at = write_u32(write_u32(at, DC_TOLERANCE_PPM), LONGEST_TIME_TO_LIVE_US);
    at = write_u8(write_u8(at, DATA_WINDOW), (uint32_t)about->entropy);
    return write_text(at, about->firmware, FIRMWARE_SIZE);
}

static uint8_t *write_health(uint8_t *at, const struct device *device) {
    const uint32_t enabled = device_is_on(device) ? AMPLIFIER_ENABLED : 0U;
    return write_u8(write_u8(at, device->known | (uint32_t)AMPLIFIER_ENABLED),
                    device->set | enabled);
}

static uint8_t *write_record(uint8_t *at, const struct record *record) {
    at = write_u8(write_u64(at, record->token), (uint32_t)record->fate);
    return write_u32(write_u32(write_u64(at, record->start_us), record->left_mvpp),
                     record->right_mvpp);
}

static uint8_t *write_measured(uint8_t *at, uint64_t token, const struct measured *measured) {
    at = write_u8(write_u8(write_u64(at, token), measured->tap), measured->unit);
    at = write_u32(write_u32(at, measured->left), measured->right);
    at = write_u32(write_u32(at, measured->onset_us), measured->uncertainty_us);
    return write_u16(write_u16(at, measured->correlation_left), measured->correlation_right);
}

static size_t respond(const struct endpoint *endpoint, const struct frame *question,
                      enum refusal refusal, const uint8_t *body, size_t body_size,
                      uint8_t answer[LONGEST_ANSWER]) {
    const struct device *device = &endpoint->device;
    struct frame frame = {.kind = (uint8_t)(question->kind | ANSWER),
                          .sequence = question->sequence};
    uint8_t *at = write_u8(write_u8(frame.payload, (uint32_t)refusal), (uint32_t)device->state);
    at = write_u64(write_u64(at, device->boot_id), device->now_us);
    if (refusal == DONE && body_size > 0U) {
        at = write_text(at, (const char *)body, body_size);
    }
    frame.size = (size_t)(at - frame.payload);
    return frame_encode(&frame, answer);
}

/* --- questions that obey the order */

/* What a question asks: its content behind the boot id, and where the answer's body goes. */
struct question {
    const uint8_t *content;
    size_t size;
    uint16_t sequence;
    uint8_t *body;
};

/* The form of a question's content: how long, how much longer it may be, where in it the slot is. A
 * token comes first, and slots and tokens are checked before the state is looked at. */
struct form {
    uint8_t kind;
    uint8_t size;
    uint8_t rest;
    uint8_t slot_at;
    bool has_token;
};
#define NO_SLOT 0xFFU

static const struct form forms[] = {
    {PING, 0, 0, NO_SLOT, false},   {LIMITS, 0, 0, NO_SLOT, false},
    {HEALTH, 0, 0, NO_SLOT, false}, {BEGIN, 5, 0, 0, false},
    {COMMIT, 5, 0, 0, false},       {DATA, 7, LONGEST_DATA - 1U, NO_SLOT, false},
    {LEVEL, 8, 0, NO_SLOT, false},  {OUTPUT, 0, 0, NO_SLOT, false},
    {ARM, 13, 0, 8, true},          {DISARM, 8, 0, NO_SLOT, true},
    {FIRE, 8, 0, NO_SLOT, true},    {QUERY, 8, 0, NO_SLOT, true},
    {MEASURED, 8, 0, NO_SLOT, true},
};

static enum refusal check_form(uint8_t kind, const struct question *question) {
    for (size_t i = 0; i < sizeof(forms) / sizeof(forms[0]); i++) {
        const struct form *form = &forms[i];
        if (form->kind != kind) {
            continue;
        }
        if (question->size < form->size || question->size > (size_t)form->size + form->rest) {
            return BAD_MESSAGE;
        }
        if (form->has_token && read_u64(question->content) == 0U) {
            return BAD_TOKEN;
        }
        const bool has_slot = form->slot_at != NO_SLOT;
        return has_slot && question->content[form->slot_at] >= SLOTS ? BAD_SLOT : DONE;
    }
    return BAD_MESSAGE;
}

/* Do what a question asks, or say why not; `body` moves behind what is told. */
static enum refusal perform(struct endpoint *endpoint, uint8_t kind, struct question *question) {
    struct device *device = &endpoint->device;
    struct upload *upload = &endpoint->upload;
    const uint8_t *content = question->content;
    const uint64_t token = question->size >= 8U ? read_u64(content) : 0U;
    struct record record = {0};
    struct measured measured = {0};
    enum refusal refusal = DONE;
    switch (kind) {
    case PING:
        break;
    case LIMITS:
        question->body = write_limits(question->body, &endpoint->about);
        break;
    case HEALTH:
        question->body = write_health(question->body, device);
        break;
    case BEGIN:
        refusal = upload_begin(upload, device, question->sequence, content[0],
                               read_u32(content + 1));
        break;
    case DATA:
        refusal = upload_add(upload, read_u16(content), read_u32(content + 2), content + 6,
                             question->size - 6U);
        break;
    case COMMIT:
        refusal = upload_finish(upload, device, content[0], read_u32(content + 1));
        break;
    case LEVEL:
        refusal = device_set_levels(device, read_u32(content), read_u32(content + 4));
        break;
    case OUTPUT:
        refusal = device_enable(device);
        break;
    case ARM:
        refusal = device_arm(device, token, content[8], read_u32(content + 9));
        break;
    case DISARM:
        device_disarm(device, token);
        break;
    case FIRE:
        refusal = device_fire(device, token, &record);
        question->body = write_record(question->body, &record);
        break;
    case QUERY:
        record = device_query(device, token);
        question->body = write_record(question->body, &record);
        break;
    case MEASURED:
        refusal = device_measured(device, token, &measured);
        question->body = write_measured(question->body, token, &measured);
        break;
    default:
        refusal = BAD_MESSAGE;
        break;
    }
    return refusal;
}

static size_t ask(struct endpoint *endpoint, uint64_t now_us, const struct frame *frame,
                  enum refusal *refusal, uint8_t answer[LONGEST_ANSWER]) {
    uint8_t body[LONGEST_PAYLOAD];
    struct question question = {.sequence = frame->sequence, .body = body};
    device_advance(&endpoint->device, now_us);
    if (frame->size < BOOT_ID_SIZE) {
        *refusal = BAD_MESSAGE;
    } else if (read_u64(frame->payload) != endpoint->device.boot_id) {
        *refusal = WRONG_BOOT;
    } else {
        question.content = frame->payload + BOOT_ID_SIZE;
        question.size = frame->size - BOOT_ID_SIZE;
        *refusal = check_form(frame->kind, &question);
        if (*refusal == DONE) {
            *refusal = perform(endpoint, frame->kind, &question);
        }
    }
    return respond(endpoint, frame, *refusal, body, (size_t)(question.body - body), answer);
}

/* --- the order of questions */

static bool is_newer(const struct endpoint *endpoint, uint16_t sequence) {
    const uint16_t ahead = (uint16_t)(sequence - endpoint->newest);
    return !endpoint->has_newest || (ahead > 0U && ahead < 0x8000U);
}

/* Whether a frame that carries nothing else is meant for this power cycle. */
static bool is_meant(const struct endpoint *endpoint, const struct frame *frame) {
    return frame->size == BOOT_ID_SIZE && read_u64(frame->payload) == endpoint->device.boot_id;
}

/* Stop, whoever asks; no question from before may undo it, however late it comes. */
static size_t stop(struct endpoint *endpoint, uint64_t now_us, const struct frame *frame,
                   uint8_t answer[LONGEST_ANSWER]) {
    device_advance(&endpoint->device, now_us);
    device_stop(&endpoint->device);
    if (is_newer(endpoint, frame->sequence) && is_meant(endpoint, frame)) {
        endpoint->newest = frame->sequence;
        endpoint->has_newest = true;
    }
    return respond(endpoint, frame, DONE, NULL, 0, answer);
}

static bool was_greeted(const struct endpoint *endpoint, uint64_t nonce) {
    for (size_t i = 0; i < GREETINGS && i < endpoint->n_greetings; i++) {
        if (endpoint->greetings[i] == nonce) {
            return true;
        }
    }
    return false;
}

/* Begin a connection; a HELLO that came before only gets its answer again. */
static size_t greet(struct endpoint *endpoint, uint64_t now_us, const struct frame *frame,
                    uint8_t answer[LONGEST_ANSWER]) {
    uint8_t body[LONGEST_PAYLOAD];
    device_advance(&endpoint->device, now_us);
    if (frame->size != 8U) {
        return respond(endpoint, frame, BAD_MESSAGE, NULL, 0, answer);
    }
    const uint64_t nonce = read_u64(frame->payload);
    if (!was_greeted(endpoint, nonce)) {
        if (endpoint->device.state != STATE_IDLE) {
            device_stop(&endpoint->device);
        }
        endpoint->greetings[endpoint->n_greetings % GREETINGS] = nonce;
        endpoint->n_greetings++;
        endpoint->newest = frame->sequence;
        endpoint->has_newest = true;
        endpoint->has_last = false;
        endpoint->upload.is_under_way = false;
    } else if (nonce != endpoint->greetings[(endpoint->n_greetings - 1U) % GREETINGS]) {
        return respond(endpoint, frame, STALE, NULL, 0, answer);
    }
    const uint8_t *end = write_greeting(body, &endpoint->about, nonce);
    return respond(endpoint, frame, DONE, body, (size_t)(end - body), answer);
}

static size_t take(struct endpoint *endpoint, uint64_t now_us, const struct frame *frame,
                   uint8_t answer[LONGEST_ANSWER]) {
    enum refusal refusal = DONE;
    if (frame->kind == BEAT) {
        if (is_meant(endpoint, frame)) {
            device_advance(&endpoint->device, now_us);
            device_hear(&endpoint->device);
        }
        return 0;
    }
    if (frame->kind == STOP) {
        return stop(endpoint, now_us, frame, answer);
    }
    if (frame->kind == HELLO) {
        return greet(endpoint, now_us, frame, answer);
    }
    if (frame->kind == DATA) { /* only writes bytes to their place: done whatever its number */
        return ask(endpoint, now_us, frame, &refusal, answer);
    }
    if (endpoint->has_last && frames_equal(frame, &endpoint->last_question)) {
        memcpy(answer, endpoint->last_answer, endpoint->last_size);
        return endpoint->last_size;
    }
    if (!is_newer(endpoint, frame->sequence)) {
        device_advance(&endpoint->device, now_us);
        return respond(endpoint, frame, STALE, NULL, 0, answer);
    }
    const size_t size = ask(endpoint, now_us, frame, &refusal, answer);
    if (refusal != WRONG_BOOT) {
        endpoint->newest = frame->sequence;
        endpoint->has_newest = true;
        endpoint->has_last = true;
        endpoint->last_question = *frame;
        endpoint->last_size = size;
        memcpy(endpoint->last_answer, answer, size);
    }
    return size;
}

static uint8_t *write_name(uint8_t *at, const char *name) {
    for (size_t i = 0; i < NAME_SIZE && name[i] != '\0'; i++) {
        at = write_u8(at, (uint8_t)name[i]);
    }
    return at;
}

static size_t tell_identity(const struct about *about, uint8_t answer[LONGEST_ANSWER]) {
    uint8_t *at = write_name(write_text(answer, "tactstrip,", 10), about->model);
    at = write_name(write_u8(at, ','), about->serial_number);
    at = write_u8(write_text(at, ",protocol ", 10), '0' + VERSION);
    at = write_u8(write_u8(write_u8(at, '.'), '0' + MINOR), '\n');
    return (size_t)(at - answer);
}

size_t endpoint_receive(struct endpoint *endpoint, uint64_t now_us, uint8_t byte,
                        uint8_t answer[LONGEST_ANSWER]) {
    struct frame frame;
    const enum received received = decoder_feed(&endpoint->decoder, byte, &frame);
    if (received == FRAME && frame.kind < ANSWER) {
        return take(endpoint, now_us, &frame, answer);
    }
    return received == IDENTITY ? tell_identity(&endpoint->about, answer) : 0U;
}

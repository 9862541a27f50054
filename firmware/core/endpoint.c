#include "endpoint.h"

#include <assert.h>
#include <string.h>

#define HEAD_SIZE 18U /* of an answer */
#define BOOT_ID_SIZE 8U
#define LINE_SIZE (9U + 1U + NAME_SIZE + 1U + NAME_SIZE + 1U + 12U + 1U)
static_assert(LINE_SIZE <= LONGEST_ANSWER, "the line of *IDN? has room where an answer has");
static_assert(VERSION < 10U && MINOR < 10U, "that line has a digit for each");

void endpoint_init(struct endpoint *endpoint, const struct about *about) {
    endpoint->about = *about;
    device_init(&endpoint->device, about->boot_id, about->sample_rate_mhz);
}

void endpoint_hang_up(struct endpoint *endpoint) {
    device_lose_line(&endpoint->device);
    endpoint->decoder = (struct decoder){.size = 0};
    endpoint->upload.is_under_way = false;
}

/* --- what an answer tells behind its head */

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
    at = write_u8(at, (uint32_t)about->entropy);
    return write_text(at, about->firmware, FIRMWARE_SIZE);
}

static uint8_t *write_health(uint8_t *at, const struct device *device) {
    const uint32_t enabled = device_is_on(device) ? AMPLIFIER_ENABLED : 0U;
    return write_u8(write_u8(at, device->known | (uint32_t)AMPLIFIER_ENABLED),
                    device->set | enabled);
}

static uint8_t *write_record(uint8_t *at, struct record record) {
    at = write_u8(write_u64(at, record.token), (uint32_t)record.fate);
    at = write_u64(at, record.start_us);
    for (uint32_t i = 0; i < CHANNELS; i++) {
        at = write_u32(at, record.levels_mvpp[i]);
    }
    return at;
}

static uint8_t *write_measured(uint8_t *at, uint64_t token, const struct measured *measured) {
    at = write_u8(write_u64(at, token), measured->tap);
    for (uint32_t i = 0; i < CHANNELS; i++) {
        at = write_u32(at, measured->peaks[i]);
    }
    at = write_u32(write_u32(at, measured->onset_us), measured->uncertainty_us);
    for (uint32_t i = 0; i < CHANNELS; i++) {
        at = write_u16(at, measured->correlations[i]);
    }
    return at;
}

/* --- waveforms in pieces */

static enum refusal upload_begin(struct endpoint *endpoint, uint16_t number, uint32_t slot,
                                 uint32_t samples) {
    struct upload *upload = &endpoint->upload;
    if (samples == 0U) {
        return WAVEFORM_EMPTY;
    }
    if (samples > LONGEST_WAVEFORM) {
        return WAVEFORM_TOO_LONG;
    }
    const enum refusal refusal = device_check_room(&endpoint->device, slot, samples);
    if (refusal == DONE) {
        upload->is_under_way = true;
        upload->number = number;
        upload->slot = slot;
        upload->samples = samples;
        upload->size = 2U * CHANNELS * samples;
        upload->missing = (upload->size + LONGEST_DATA - 1U) / LONGEST_DATA;
        memset(upload->came, 0, sizeof(upload->came));
    }
    return refusal;
}

static enum refusal upload_add(struct upload *upload, uint16_t number, uint32_t offset,
                               const uint8_t *bytes, size_t size) {
    if (!upload->is_under_way || number != upload->number || offset % LONGEST_DATA != 0U ||
        offset >= upload->size) {
        return BAD_UPLOAD;
    }
    const uint32_t left = upload->size - offset;
    if (size != (left < LONGEST_DATA ? left : LONGEST_DATA)) {
        return BAD_UPLOAD;
    }
    const uint32_t piece = offset / LONGEST_DATA;
    const uint8_t bit = (uint8_t)(1U << (piece % 8U));
    if ((upload->came[piece / 8U] & bit) == 0U) {
        upload->came[piece / 8U] |= bit;
        upload->missing--;
    }
    memcpy(&upload->bytes[offset], bytes, size);
    return DONE;
}

/* Store the waveform if all of it came and has this checksum; the upload is over in any case. */
static enum refusal upload_finish(struct endpoint *endpoint, uint32_t slot, uint32_t crc) {
    struct upload *upload = &endpoint->upload;
    const bool is_whole = upload->is_under_way && upload->slot == slot && upload->missing == 0U;
    upload->is_under_way = false;
    if (!is_whole || crc32(0, upload->bytes, upload->size) != crc) {
        return BAD_UPLOAD;
    }
    return device_load(&endpoint->device, slot, upload->samples, upload->bytes);
}

/* --- questions; where one is done, `end` moves behind what its answer tells */

/* The form of what is behind the boot id: how long, how much longer it may be, where in it the slot
 * is. A token comes first, and slots and tokens are checked before the state is looked at. */
struct form {
    uint8_t kind;
    uint8_t size;
    uint8_t rest;
    uint8_t slot_at;
    bool has_token;
};
#define NO_SLOT 0xFFU
#define LEVEL_REST (LONGEST_PAYLOAD - BOOT_ID_SIZE) /* of any number of channels */

static const struct form forms[] = {
    {PING, 0, 0, NO_SLOT, false},   {LIMITS, 0, 0, NO_SLOT, false},
    {HEALTH, 0, 0, NO_SLOT, false}, {BEGIN, 5, 0, 0, false},
    {COMMIT, 5, 0, 0, false},       {DATA, 7, LONGEST_DATA - 1U, NO_SLOT, false},
    {LEVEL, 0, LEVEL_REST, NO_SLOT, false}, {OUTPUT, 0, 0, NO_SLOT, false},
    {ARM, 13, 0, 8, true},          {DISARM, 8, 0, NO_SLOT, true},
    {FIRE, 8, 0, NO_SLOT, true},    {QUERY, 8, 0, NO_SLOT, true},
    {MEASURED, 8, 0, NO_SLOT, true},
};
#define FORMS (sizeof(forms) / sizeof(forms[0]))

static enum refusal check_form(uint8_t kind, const uint8_t *content, size_t size) {
    const struct form *form = forms;
    while (form < forms + FORMS && form->kind != kind) {
        form++;
    }
    if (form == forms + FORMS || size < form->size || size > (size_t)form->size + form->rest) {
        return BAD_MESSAGE;
    }
    if (form->has_token && read_u64(content) == 0U) {
        return BAD_TOKEN;
    }
    return form->slot_at != NO_SLOT && content[form->slot_at] >= SLOTS ? BAD_SLOT : DONE;
}

static enum refusal set_levels(struct device *device, const uint8_t *content, size_t size) {
    uint32_t levels_mvpp[CHANNELS];
    if (size % sizeof(levels_mvpp[0]) != 0U) {
        return BAD_MESSAGE;
    }
    if (size != sizeof(levels_mvpp)) {
        return WRONG_CHANNELS;
    }
    for (uint32_t i = 0; i < CHANNELS; i++) {
        levels_mvpp[i] = read_u32(content + sizeof(levels_mvpp[0]) * (size_t)i);
    }
    return device_set_levels(device, levels_mvpp);
}

static enum refusal perform(struct endpoint *endpoint, const struct frame *frame, uint8_t **end) {
    struct device *device = &endpoint->device;
    const uint8_t *content = frame->payload + BOOT_ID_SIZE;
    const size_t size = frame->size - BOOT_ID_SIZE;
    enum refusal refusal = check_form(frame->kind, content, size);
    if (refusal != DONE) {
        return refusal;
    }
    const uint64_t token = size >= 8U ? read_u64(content) : 0U;
    struct measured measured;
    switch (frame->kind) {
    case LIMITS:
        *end = write_limits(*end, &endpoint->about);
        break;
    case HEALTH:
        *end = write_health(*end, device);
        break;
    case BEGIN:
        refusal = upload_begin(endpoint, frame->sequence, content[0], read_u32(content + 1));
        break;
    case DATA:
        refusal = upload_add(&endpoint->upload, read_u16(content), read_u32(content + 2),
                             content + 6, size - 6U);
        break;
    case COMMIT:
        refusal = upload_finish(endpoint, content[0], read_u32(content + 1));
        break;
    case LEVEL:
        refusal = set_levels(device, content, size);
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
        refusal = device_fire(device, token);
        *end = write_record(*end, device_query(device, token));
        break;
    case QUERY:
        *end = write_record(*end, device_query(device, token));
        break;
    case MEASURED:
        refusal = device_measured(device, token, &measured);
        *end = write_measured(*end, token, &measured);
        break;
    default: /* PING */
        break;
    }
    return refusal;
}

static enum refusal ask(struct endpoint *endpoint, const struct frame *frame, uint8_t **end) {
    if (frame->size < BOOT_ID_SIZE) {
        return BAD_MESSAGE;
    }
    const bool is_ours = read_u64(frame->payload) == endpoint->device.boot_id;
    return is_ours ? perform(endpoint, frame, end) : WRONG_BOOT;
}

/* --- the order of questions */

static bool is_newer(const struct endpoint *endpoint, uint16_t sequence) {
    const uint16_t ahead = (uint16_t)(sequence - endpoint->newest);
    return !endpoint->has_newest || (ahead > 0U && ahead < 0x8000U);
}

static void note_newest(struct endpoint *endpoint, uint16_t sequence) {
    endpoint->newest = sequence;
    endpoint->has_newest = true;
}

/* Whether a frame that carries nothing else is meant for this power cycle. */
static bool is_meant(const struct endpoint *endpoint, const struct frame *frame) {
    return frame->size == BOOT_ID_SIZE && read_u64(frame->payload) == endpoint->device.boot_id;
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
static enum refusal greet(struct endpoint *endpoint, const struct frame *frame, uint8_t **end) {
    if (frame->size != 8U) {
        return BAD_MESSAGE;
    }
    const uint64_t nonce = read_u64(frame->payload);
    if (!was_greeted(endpoint, nonce)) {
        if (endpoint->device.state != STATE_IDLE) {
            device_stop(&endpoint->device);
        }
        endpoint->greetings[endpoint->n_greetings % GREETINGS] = nonce;
        endpoint->n_greetings++;
        note_newest(endpoint, frame->sequence);
        endpoint->last_size = 0;
        endpoint->upload.is_under_way = false;
    } else if (nonce != endpoint->greetings[(endpoint->n_greetings - 1U) % GREETINGS]) {
        return STALE;
    }
    *end = write_greeting(*end, &endpoint->about, nonce);
    return DONE;
}

static bool is_repeated(const struct endpoint *endpoint, const struct frame *frame) {
    const struct frame *last = &endpoint->last_question;
    return endpoint->last_size > 0U && frame->kind == last->kind &&
           frame->sequence == last->sequence && frame->size == last->size &&
           memcmp(frame->payload, last->payload, last->size) == 0;
}

/* Do what a question asks, in its order; return the size of its answer. */
static size_t take(struct endpoint *endpoint, const struct frame *frame,
                   uint8_t answer[LONGEST_ANSWER]) {
    const struct device *device = &endpoint->device;
    struct frame reply = {.kind = (uint8_t)(frame->kind | ANSWER), .sequence = frame->sequence};
    uint8_t *end = reply.payload + HEAD_SIZE;
    enum refusal refusal = DONE;
    bool is_in_order = false;
    if (is_repeated(endpoint, frame)) {
        memcpy(answer, endpoint->last_answer, endpoint->last_size);
        return endpoint->last_size;
    }
    switch (frame->kind) {
    case BEAT:
        if (is_meant(endpoint, frame)) {
            device_hear(&endpoint->device);
        }
        return 0;
    case STOP: /* whoever asks; no question from before may undo it, however late it comes */
        device_stop(&endpoint->device);
        if (is_newer(endpoint, frame->sequence) && is_meant(endpoint, frame)) {
            note_newest(endpoint, frame->sequence);
        }
        break;
    case HELLO:
        refusal = greet(endpoint, frame, &end);
        break;
    case DATA: /* only writes bytes to their place: done whatever its number */
        refusal = ask(endpoint, frame, &end);
        break;
    default:
        refusal = is_newer(endpoint, frame->sequence) ? ask(endpoint, frame, &end) : STALE;
        is_in_order = refusal != STALE && refusal != WRONG_BOOT;
        break;
    }
    uint8_t *at = write_u8(write_u8(reply.payload, (uint32_t)refusal), (uint32_t)device->state);
    at = write_u64(write_u64(at, device->boot_id), device->now_us);
    reply.size = (size_t)((refusal == DONE ? end : at) - reply.payload);
    const size_t size = frame_encode(&reply, answer);
    if (is_in_order) {
        note_newest(endpoint, frame->sequence);
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

size_t endpoint_receive(struct endpoint *endpoint, uint8_t byte, uint8_t answer[LONGEST_ANSWER]) {
    struct frame frame;
    const enum received received = decoder_feed(&endpoint->decoder, byte, &frame);
    if (received == FRAME && frame.kind < ANSWER) {
        return take(endpoint, &frame, answer);
    }
    return received == IDENTITY ? tell_identity(&endpoint->about, answer) : 0U;
}

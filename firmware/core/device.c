#include "device.h"

#include "frames.h"

#include <string.h>

#define MILLION 1000000U

/* The states in which a step is legal, as bits. Nothing is loaded and no level set while a token is
 * armed or plays, lest something else is felt than was armed. Out of SAFE leads ENABLE alone. */
enum legal {
    LEGAL_ENABLE = 1U << STATE_LOADED | 1U << STATE_LIVE | 1U << STATE_SAFE,
    LEGAL_LOAD = 1U << STATE_IDLE | LEGAL_ENABLE, /* and LEVEL */
    LEGAL_ARM = 1U << STATE_LIVE,
    LEGAL_FIRE = 1U << STATE_ARMED,
};

static enum refusal check_state(const struct device *device, enum legal legal) {
    static const enum refusal reasons[] = {
        [STATE_IDLE] = NOTHING_LOADED, [STATE_LOADED] = NOT_ENABLED, [STATE_LIVE] = NOT_ARMED,
        [STATE_ARMED] = ALREADY_ARMED, [STATE_FIRED] = BUSY,
    };
    if (((uint32_t)legal & (1U << device->state)) != 0U) {
        return DONE;
    }
    return device->state == STATE_SAFE ? device->off_reason : reasons[device->state];
}

/* Return the record of a token, or NULL. The newest comes first, so that the answer to FIRE takes
 * no longer late in a session. */
static const struct record *find(const struct device *device, uint64_t token) {
    for (size_t age = 1; age <= HISTORY; age++) {
        const size_t at = (device->next_record + HISTORY - age) % HISTORY;
        if (device->records[at].token == token) {
            return &device->records[at];
        }
    }
    return NULL;
}

/* Return what can be said of a token that has no record: it has not fired. At least not this time:
 * of one that may have been forgotten since it fired nothing else is known. */
static struct record unfired(const struct device *device, uint64_t token, enum fate fate) {
    const bool is_known = token > device->dropped_up_to;
    return (struct record){.token = token, .fate = is_known ? fate : FATE_UNKNOWN};
}

/* Add the record of a token that has none; the oldest makes room. */
static void keep(struct device *device, struct record record) {
    struct record *oldest = &device->records[device->next_record];
    if (oldest->token > device->dropped_up_to) {
        device->dropped_up_to = oldest->token;
    }
    *oldest = record;
    device->next_record = (device->next_record + 1U) % HISTORY;
}

/* Put the token that is armed, if there is one, into the history. */
static void resolve(struct device *device, enum fate fate) {
    if (device->armed != 0U) {
        keep(device, unfired(device, device->armed, fate));
        device->armed = 0;
    }
}

/* The first reason counts: a stop that comes later does not hide it. */
static void stop(struct device *device, uint64_t at_us, enum refusal reason) {
    if (device->state != STATE_SAFE) {
        device->off_reason = reason;
    }
    if (device->state == STATE_FIRED) {
        device->last.is_cut = true;
        device->last.cut_us = at_us;
        device->measured_token = 0;
    }
    resolve(device, FATE_ABORTED);
    device->state = STATE_SAFE;
}

void device_init(struct device *device, uint64_t boot_id, uint32_t sample_rate_mhz) {
    device->boot_id = boot_id;
    device->sample_rate_mhz = sample_rate_mhz;
}

void device_advance(struct device *device, uint64_t now_us) {
    const uint64_t silent_us = device->beat_us + WATCHDOG_US;
    const uint64_t by_us = now_us < silent_us ? now_us : silent_us;
    if (device->state == STATE_ARMED && device->armed_until_us <= by_us) {
        resolve(device, FATE_EXPIRED);
        device->state = STATE_LIVE;
    }
    if (device->state == STATE_FIRED &&
        device->last.start_us + device->last.duration_us <= by_us) {
        device->measured_token = 0;
        device->state = STATE_LIVE;
    }
    if (device_is_on(device) && silent_us <= now_us) {
        stop(device, silent_us, WATCHDOG_STOP);
    }
    device->now_us = now_us;
}

void device_sense(struct device *device, uint8_t known, uint8_t set) {
    const uint32_t latched = (uint32_t)device->set & OVER_CURRENT;
    const uint32_t reported = (uint32_t)known & (SWITCH_CLOSED | OVER_CURRENT);
    device->known = (uint8_t)(reported | latched);
    device->set = (uint8_t)((reported & set) | latched);
    if ((reported & set & OVER_CURRENT) != 0U) {
        stop(device, device->now_us, OVERLOAD_STOP);
    }
}

static bool has_ended(const struct device *device) {
    return device->state != STATE_FIRED && !device->last.is_cut;
}

void device_begin_measuring(struct device *device) { device->is_measuring = has_ended(device); }

void device_measure(struct device *device, const struct measured *measured) {
    device->is_measuring = false;
    if (has_ended(device)) {
        device->measured_token = device->last.token;
        device->measured = *measured;
    }
}

/* Return the samples of one channel in all slots but one. */
static uint32_t others(const struct device *device, uint32_t slot) {
    uint32_t samples = 0;
    for (uint32_t i = 0; i < SLOTS; i++) {
        samples += i == slot ? 0U : device->slots[i].samples;
    }
    return samples;
}

enum refusal device_check_room(const struct device *device, uint32_t slot, uint32_t samples) {
    return samples > MEMORY_SAMPLES - others(device, slot) ? MEMORY_FULL : DONE;
}

/* Check the codes of one channel, 16 bit little endian: in range, 0 at both ends, no DC part. */
static enum refusal check_codes(const uint8_t *codes, uint32_t samples, uint32_t *peak) {
    int64_t sum = 0;
    uint64_t magnitudes = 0;
    *peak = 0;
    for (uint32_t i = 0; i < samples; i++) {
        const int16_t code = (int16_t)read_u16(codes + 2U * (size_t)i);
        const uint32_t magnitude = (uint32_t)(code < 0 ? -(int32_t)code : (int32_t)code);
        *peak = magnitude > *peak ? magnitude : *peak;
        sum += code;
        magnitudes += magnitude;
    }
    if (*peak > (uint32_t)FULL_SCALE) {
        return OUT_OF_RANGE;
    }
    if (read_u16(codes) != 0U || read_u16(codes + 2U * (size_t)(samples - 1U)) != 0U) {
        return EDGES_NOT_ZERO;
    }
    const uint64_t dc = (uint64_t)(sum < 0 ? -sum : sum);
    return dc * MILLION > magnitudes * DC_TOLERANCE_PPM ? DC : DONE;
}

/* Store codes behind those of all other slots; these move together where the slot had some. */
static void store(struct device *device, uint32_t slot, uint32_t samples, const uint8_t *codes) {
    const uint32_t end = CHANNELS * others(device, slot);
    const uint32_t size = CHANNELS * device->slots[slot].samples;
    const uint32_t begin = size > 0U ? device->slots[slot].begin : end;
    for (uint32_t i = 0; i < SLOTS; i++) {
        device->slots[i].begin -= device->slots[i].begin > begin ? size : 0U;
    }
    memmove(&device->memory[begin], &device->memory[begin + size], 2U * (end - begin));
    for (uint32_t i = 0; i < CHANNELS * samples; i++) {
        device->memory[end + i] = (int16_t)read_u16(codes + 2U * (size_t)i);
    }
    device->slots[slot].begin = end;
    device->slots[slot].samples = samples;
    device->is_measuring = false;
}

enum refusal device_load(struct device *device, uint32_t slot, uint32_t samples,
                         const uint8_t *codes) {
    uint32_t peaks[CHANNELS] = {0};
    enum refusal refusal = check_state(device, LEGAL_LOAD);
    for (uint32_t i = 0; i < CHANNELS && refusal == DONE; i++) {
        refusal = check_codes(codes + 2U * (size_t)samples * i, samples, &peaks[i]);
    }
    if (refusal == DONE) {
        store(device, slot, samples, codes);
        memcpy(device->slots[slot].peaks, peaks, sizeof(peaks));
        device->state = device->state == STATE_IDLE ? STATE_LOADED : device->state;
    }
    return refusal;
}

/* Exactly at the ceiling is allowed; 15 bits times 32 have room in 64. */
static enum refusal check_ceiling(const uint32_t peaks[CHANNELS],
                                  const uint32_t levels_mvpp[CHANNELS]) {
    for (uint32_t i = 0; i < CHANNELS; i++) {
        if ((uint64_t)peaks[i] * levels_mvpp[i] > (uint64_t)CEILING_MVPP * FULL_SCALE) {
            return CEILING;
        }
    }
    return DONE;
}

/* A level that is too high even for the quietest waveform of its channel cannot be used. */
enum refusal device_set_levels(struct device *device, const uint32_t levels_mvpp[CHANNELS]) {
    uint32_t peaks[CHANNELS] = {0};
    for (uint32_t i = 0; i < SLOTS; i++) {
        for (uint32_t j = 0; j < CHANNELS; j++) {
            const uint32_t peak = device->slots[i].peaks[j];
            if (peak > 0U && (peaks[j] == 0U || peak < peaks[j])) {
                peaks[j] = peak;
            }
        }
    }
    enum refusal refusal = check_state(device, LEGAL_LOAD);
    if (refusal == DONE) {
        refusal = check_ceiling(peaks, levels_mvpp);
    }
    if (refusal == DONE) {
        memcpy(device->levels_mvpp, levels_mvpp, sizeof(device->levels_mvpp));
    }
    return refusal;
}

/* The watchdog waits from here for its first beat. */
enum refusal device_enable(struct device *device) {
    const enum refusal refusal = check_state(device, LEGAL_ENABLE);
    if (refusal == DONE) {
        device->beat_us = device->now_us;
        device->set &= (uint8_t)SWITCH_CLOSED;
        device->state = STATE_LIVE;
    }
    return refusal;
}

static enum refusal check_amplifier(const struct device *device) {
    const bool is_open =
        (device->known & SWITCH_CLOSED) != 0U && (device->set & SWITCH_CLOSED) == 0U;
    return is_open ? AMPLIFIER_OFF : DONE;
}

enum refusal device_arm(struct device *device, uint64_t token, uint32_t slot,
                        uint32_t time_to_live_us) {
    enum refusal refusal = check_state(device, LEGAL_ARM);
    if (refusal == DONE) {
        refusal = check_amplifier(device);
    }
    if (refusal != DONE) {
        return refusal;
    }
    if (time_to_live_us == 0U || time_to_live_us > LONGEST_TIME_TO_LIVE_US) {
        return BAD_TIME_TO_LIVE;
    }
    if (find(device, token) != NULL) {
        return TOKEN_SPENT;
    }
    if (device->slots[slot].samples == 0U) {
        return EMPTY_SLOT;
    }
    refusal = check_ceiling(device->slots[slot].peaks, device->levels_mvpp);
    if (refusal == DONE) {
        device->armed = token;
        device->armed_slot = slot;
        device->armed_until_us = device->now_us + time_to_live_us;
        device->state = STATE_ARMED;
    }
    return refusal;
}

/* Each burst pays for its own rest, so that the duty stays within its limit over any long time. */
static enum refusal check_rest(const struct device *device) {
    const struct burst *last = &device->last;
    if (last->token == 0U) {
        return DONE;
    }
    const uint64_t since_us = device->now_us - last->start_us;
    if (since_us < last->duration_us + LEAST_INTERVAL_US) {
        return LEAST_INTERVAL;
    }
    const uint64_t least_us =
        (last->duration_us * MILLION + (MAX_DUTY_PPM - 1U)) / MAX_DUTY_PPM;
    return since_us < least_us ? DUTY : DONE;
}

/* Let the token that is armed play. */
static void emit(struct device *device) {
    const struct slot *slot = &device->slots[device->armed_slot];
    const uint64_t samples_1e9 = (uint64_t)slot->samples * 1000U * MILLION;
    struct record record = {
        .token = device->armed, .start_us = device->now_us, .fate = FATE_FIRED};
    for (uint32_t i = 0; i < CHANNELS; i++) {
        record.levels_mvpp[i] = slot->peaks[i] > 0U ? device->levels_mvpp[i] : 0U;
    }
    device->last = (struct burst){
        .token = record.token,
        .start_us = record.start_us,
        .duration_us = (samples_1e9 + device->sample_rate_mhz - 1U) / device->sample_rate_mhz,
        .slot = device->armed_slot,
    };
    memcpy(device->last.levels_mvpp, record.levels_mvpp, sizeof(record.levels_mvpp));
    keep(device, record);
    device->armed = 0;
    device->is_measuring = false;
    device->state = STATE_FIRED;
}

/* The history is asked before the state: a token that has fired is answered with its record in
 * every state, so that a FIRE whose answer was lost can be sent again at any time. */
enum refusal device_fire(struct device *device, uint64_t token) {
    const struct record *found = token == device->armed ? NULL : find(device, token);
    if (found != NULL && found->fate == FATE_FIRED) {
        return DONE;
    }
    if (found != NULL && device->state != STATE_SAFE) {
        return found->fate == FATE_EXPIRED ? EXPIRED : ABORTED;
    }
    enum refusal refusal = check_state(device, LEGAL_FIRE);
    if (refusal == DONE && token != device->armed) {
        refusal = WRONG_TOKEN;
    }
    if (refusal == DONE) {
        refusal = check_amplifier(device);
    }
    if (refusal == DONE) {
        refusal = check_rest(device);
    }
    if (refusal == DONE) {
        emit(device);
    }
    return refusal;
}

/* A token that was never here is kept too: its ARM may still be under way. */
void device_disarm(struct device *device, uint64_t token) {
    if (device->armed == token) {
        resolve(device, FATE_ABORTED);
        device->state = STATE_LIVE;
    } else if (find(device, token) == NULL) {
        keep(device, unfired(device, token, FATE_NEVER_ARMED));
    }
}

struct record device_query(const struct device *device, uint64_t token) {
    if (device->armed == token) {
        return (struct record){.token = token, .fate = FATE_ARMED};
    }
    const struct record *found = find(device, token);
    return found != NULL ? *found : unfired(device, token, FATE_NEVER_ARMED);
}

enum refusal device_measured(const struct device *device, uint64_t token,
                             struct measured *measured) {
    const bool is_known = token == device->measured_token;
    *measured = is_known ? device->measured : (struct measured){.tap = TAP_NONE};
    const bool is_waiting = device->state == STATE_FIRED || device->is_measuring;
    return token == device->last.token && is_waiting ? BUSY : DONE;
}

void device_stop(struct device *device) { stop(device, device->now_us, SAFE_STATE); }

void device_lose_line(struct device *device) { stop(device, device->now_us, LINE_STOP); }

void device_hear(struct device *device) { device->beat_us = device->now_us; }

bool device_is_on(const struct device *device) {
    const enum state state = device->state;
    return state == STATE_LIVE || state == STATE_ARMED || state == STATE_FIRED;
}

int32_t device_step(const struct device *device, const struct burst *burst, uint32_t channel,
                    uint32_t sample) {
    const struct slot *slot = &device->slots[burst->slot];
    const int32_t code = device->memory[slot->begin + channel * slot->samples + sample];
    const uint64_t magnitude = (uint64_t)(code < 0 ? -code : code);
    const int32_t step = (int32_t)(magnitude * burst->levels_mvpp[channel] / RAIL_MVPP);
    return code < 0 ? -step : step;
}

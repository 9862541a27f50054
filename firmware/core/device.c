#include "device.h"

#include "frames.h"

#include <string.h>

#define MILLION 1000000U

enum step {
    STEP_LOAD,
    STEP_LEVEL,
    STEP_ENABLE,
    STEP_ARM,
    STEP_FIRE,
    STEP_DISARM,
    STEP_EXPIRE,
    STEP_FINISH,
    STEP_STOP,
    STEPS,
};
#define NONE 0xFFU
#define STATES 6

/* Every legal step: from the state of the row by the step of the column to the state in the cell.
 * LOAD and LEVEL stand here even where they change no state: while a token is armed or plays they
 * are illegal, lest something else is felt than was armed. Out of SAFE leads ENABLE alone. */
static const uint8_t transitions[STATES][STEPS] = {
    [STATE_IDLE] = {STATE_LOADED, STATE_IDLE, NONE, NONE, NONE, NONE, NONE, NONE, STATE_SAFE},
    [STATE_LOADED] = {STATE_LOADED, STATE_LOADED, STATE_LIVE, NONE, NONE, NONE, NONE, NONE,
                      STATE_SAFE},
    [STATE_LIVE] = {STATE_LIVE, STATE_LIVE, STATE_LIVE, STATE_ARMED, NONE, NONE, NONE, NONE,
                    STATE_SAFE},
    [STATE_ARMED] = {NONE, NONE, NONE, NONE, STATE_FIRED, STATE_LIVE, STATE_LIVE, NONE, STATE_SAFE},
    [STATE_FIRED] = {NONE, NONE, NONE, NONE, NONE, NONE, NONE, STATE_LIVE, STATE_SAFE},
    [STATE_SAFE] = {STATE_SAFE, STATE_SAFE, STATE_LIVE, NONE, NONE, NONE, NONE, NONE, STATE_SAFE},
};

/* Why any other step is refused. */
static const enum refusal illegal[STATES] = {
    [STATE_IDLE] = NOTHING_LOADED, [STATE_LOADED] = NOT_ENABLED, [STATE_LIVE] = NOT_ARMED,
    [STATE_ARMED] = ALREADY_ARMED, [STATE_FIRED] = BUSY,         [STATE_SAFE] = SAFE_STATE,
};

static enum refusal check_step(const struct device *device, enum step step) {
    return transitions[device->state][step] == NONE ? illegal[device->state] : DONE;
}

static void go(struct device *device, enum step step) {
    device->state = (enum state)transitions[device->state][step];
}

/* Put the token that is armed, if there is one, into the history: it has not fired. At least not
 * this time: of one that may have been forgotten since it fired, that is all that can be said. */
static void resolve(struct device *device, enum fate fate) {
    if (device->armed != 0U) {
        struct record record = tokens_absent(&device->tokens, device->armed);
        if (record.fate != FATE_UNKNOWN) {
            record.fate = fate;
        }
        tokens_keep(&device->tokens, &record);
        device->armed = 0;
    }
}

static void happen(struct device *device, uint64_t at_us, enum step step) {
    if (device->state == STATE_FIRED) {
        device->last.is_over = true;
        device->last.is_cut = step == STEP_STOP;
        device->last.cut_us = at_us;
        device->measured_token = 0;
    }
    resolve(device, step == STEP_EXPIRE ? FATE_EXPIRED : FATE_ABORTED);
    go(device, step);
}

void device_init(struct device *device, uint64_t boot_id, uint32_t sample_rate_mhz) {
    device->boot_id = boot_id;
    device->sample_rate_mhz = sample_rate_mhz;
    device->last.is_over = true;
}

/* Tell what happens next by itself and when; false if nothing does. */
static bool next_event(const struct device *device, uint64_t *at_us, enum step *step) {
    if (!device_is_on(device)) {
        return false;
    }
    *at_us = device->beat_us + WATCHDOG_US;
    *step = STEP_STOP;
    uint64_t own_us = *at_us;
    if (device->state == STATE_ARMED) {
        own_us = device->armed_until_us;
    } else if (device->state == STATE_FIRED) {
        own_us = device->last.start_us + device->last.duration_us;
    } else {
        return true;
    }
    if (own_us <= *at_us) {
        *at_us = own_us;
        *step = device->state == STATE_ARMED ? STEP_EXPIRE : STEP_FINISH;
    }
    return true;
}

void device_advance(struct device *device, uint64_t now_us) {
    uint64_t at_us = 0;
    enum step step = STEP_STOP;
    while (next_event(device, &at_us, &step) && at_us <= now_us) {
        happen(device, at_us, step);
    }
    device->now_us = now_us;
}

void device_sense(struct device *device, uint64_t now_us, uint8_t known, uint8_t set) {
    device_advance(device, now_us);
    const uint32_t latched = (uint32_t)device->set & OVER_CURRENT;
    const uint32_t reported = (uint32_t)known & (SWITCH_CLOSED | OVER_CURRENT);
    device->known = (uint8_t)(reported | latched);
    device->set = (uint8_t)((reported & set) | latched);
    if ((reported & set & OVER_CURRENT) != 0U) {
        happen(device, now_us, STEP_STOP);
    }
}

void device_begin_measuring(struct device *device) {
    device->is_measuring = device->last.is_over && !device->last.is_cut;
}

void device_measure(struct device *device, const struct measured *measured) {
    device->is_measuring = false;
    if (device->last.is_over && !device->last.is_cut) {
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

/* Empty a slot; the waveforms behind it move together. */
static void clear_slot(struct device *device, uint32_t slot) {
    const uint32_t begin = device->slots[slot].begin;
    const uint32_t size = CHANNELS * device->slots[slot].samples;
    const uint32_t behind = CHANNELS * others(device, slot) - begin;
    for (uint32_t i = 0; i < SLOTS; i++) {
        if (device->slots[i].samples > 0U && device->slots[i].begin > begin) {
            device->slots[i].begin -= size;
        }
    }
    memmove(&device->memory[begin], &device->memory[begin + size], behind * sizeof(int16_t));
    device->slots[slot].samples = 0;
}

static void store(struct device *device, uint32_t slot, uint32_t samples, const uint8_t *codes) {
    if (device->slots[slot].samples > 0U) {
        clear_slot(device, slot);
    }
    const uint32_t begin = CHANNELS * others(device, slot);
    device->is_measuring = false;
    for (uint32_t i = 0; i < CHANNELS * samples; i++) {
        device->memory[begin + i] = (int16_t)read_u16(codes + 2U * (size_t)i);
    }
    device->slots[slot].begin = begin;
    device->slots[slot].samples = samples;
}

enum refusal device_load(struct device *device, uint32_t slot, uint32_t samples,
                         const uint8_t *codes) {
    uint32_t peaks[CHANNELS] = {0, 0};
    enum refusal refusal = check_step(device, STEP_LOAD);
    for (uint32_t i = 0; i < CHANNELS && refusal == DONE; i++) {
        refusal = check_codes(codes + 2U * (size_t)samples * i, samples, &peaks[i]);
    }
    if (refusal == DONE) {
        store(device, slot, samples, codes);
        memcpy(device->slots[slot].peaks, peaks, sizeof(peaks));
        go(device, STEP_LOAD);
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
enum refusal device_set_levels(struct device *device, uint32_t left_mvpp, uint32_t right_mvpp) {
    const uint32_t levels_mvpp[CHANNELS] = {left_mvpp, right_mvpp};
    uint32_t peaks[CHANNELS] = {0, 0};
    for (uint32_t i = 0; i < SLOTS; i++) {
        for (uint32_t j = 0; j < CHANNELS; j++) {
            const uint32_t peak = device->slots[i].samples > 0U ? device->slots[i].peaks[j] : 0U;
            if (peak > 0U && (peaks[j] == 0U || peak < peaks[j])) {
                peaks[j] = peak;
            }
        }
    }
    enum refusal refusal = check_step(device, STEP_LEVEL);
    if (refusal == DONE) {
        refusal = check_ceiling(peaks, levels_mvpp);
    }
    if (refusal == DONE) {
        memcpy(device->levels_mvpp, levels_mvpp, sizeof(levels_mvpp));
        go(device, STEP_LEVEL);
    }
    return refusal;
}

/* The watchdog waits from here for its first beat. */
enum refusal device_enable(struct device *device) {
    const enum refusal refusal = check_step(device, STEP_ENABLE);
    if (refusal == DONE) {
        device->beat_us = device->now_us;
        device->set &= (uint8_t)SWITCH_CLOSED;
        go(device, STEP_ENABLE);
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
    enum refusal refusal = check_step(device, STEP_ARM);
    if (refusal == DONE) {
        refusal = check_amplifier(device);
    }
    if (refusal != DONE) {
        return refusal;
    }
    if (time_to_live_us == 0U || time_to_live_us > LONGEST_TIME_TO_LIVE_US) {
        return BAD_TIME_TO_LIVE;
    }
    if (tokens_find(&device->tokens, token) != NULL) {
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
        go(device, STEP_ARM);
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

static void emit(struct device *device) {
    const struct slot *slot = &device->slots[device->armed_slot];
    const uint64_t samples_1e9 = (uint64_t)slot->samples * 1000U * MILLION;
    struct burst *burst = &device->last;
    device->is_measuring = false;
    memset(burst, 0, sizeof(*burst));
    burst->token = device->armed;
    burst->start_us = device->now_us;
    burst->duration_us =
        (samples_1e9 + (device->sample_rate_mhz - 1U)) / device->sample_rate_mhz;
    burst->slot = device->armed_slot;
    for (uint32_t i = 0; i < CHANNELS; i++) {
        burst->levels_mvpp[i] = slot->peaks[i] > 0U ? device->levels_mvpp[i] : 0U;
    }
}

/* The history is asked before the state: a token that has fired is answered with its record in
 * every state, so that a FIRE whose answer was lost can be sent again at any time. */
enum refusal device_fire(struct device *device, uint64_t token, struct record *record) {
    const struct record *found = tokens_find(&device->tokens, token);
    if (found != NULL && found->fate == FATE_FIRED) {
        *record = *found;
        return DONE;
    }
    if (found != NULL && device->state != STATE_SAFE) {
        return found->fate == FATE_EXPIRED ? EXPIRED : ABORTED;
    }
    enum refusal refusal = check_step(device, STEP_FIRE);
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
        *record = (struct record){.token = token,
                                  .start_us = device->last.start_us,
                                  .left_mvpp = device->last.levels_mvpp[0],
                                  .right_mvpp = device->last.levels_mvpp[1],
                                  .fate = FATE_FIRED};
        tokens_keep(&device->tokens, record);
        device->armed = 0;
        go(device, STEP_FIRE);
    }
    return refusal;
}

/* A token that was never here is kept too: its ARM may still be under way. */
void device_disarm(struct device *device, uint64_t token) {
    if (device->armed == token) {
        resolve(device, FATE_ABORTED);
        go(device, STEP_DISARM);
    } else if (tokens_find(&device->tokens, token) == NULL) {
        const struct record record = tokens_absent(&device->tokens, token);
        tokens_keep(&device->tokens, &record);
    }
}

struct record device_query(const struct device *device, uint64_t token) {
    const struct record *found = tokens_find(&device->tokens, token);
    if (device->armed == token) {
        return (struct record){.token = token, .fate = FATE_ARMED};
    }
    return found != NULL ? *found : tokens_absent(&device->tokens, token);
}

enum refusal device_measured(const struct device *device, uint64_t token,
                             struct measured *measured) {
    memset(measured, 0, sizeof(*measured));
    if (token == device->last.token && (device->state == STATE_FIRED || device->is_measuring)) {
        return BUSY;
    }
    if (token == device->measured_token) {
        *measured = device->measured;
    }
    return DONE;
}

void device_stop(struct device *device) { happen(device, device->now_us, STEP_STOP); }

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

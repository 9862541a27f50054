/* The device's own logic, without I/O and without a clock: states, tokens, watchdog, ceilings.
 *
 * Everything takes place at the time of the last `device_advance`, in microseconds, never less than
 * the time before. A step that is refused has changed nothing. */
#ifndef DEVICE_H
#define DEVICE_H

#include "limits.h"
#include "wire_numbers.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What a monitor saw of one burst; peaks are magnitudes in the tap's unit, correlations in 1e-4. */
struct measured {
    uint8_t tap;
    uint32_t peaks[CHANNELS];
    uint32_t onset_us;
    uint32_t uncertainty_us;
    uint16_t correlations[CHANNELS];
};

/* The codes of the channels in the device's memory, one after the other; no samples: empty. */
struct slot {
    uint32_t begin;
    uint32_t samples;
    uint32_t peaks[CHANNELS];
};

/* What became of a token; onset and levels are 0 unless it fired. */
struct record {
    uint64_t token;
    uint64_t start_us;
    uint32_t levels_mvpp[CHANNELS];
    enum fate fate;
};

/* One burst: what the converter has to play from `start_us` on, and until when if it was cut. */
struct burst {
    uint64_t token;
    uint64_t start_us;
    uint64_t duration_us;
    uint64_t cut_us;
    uint32_t levels_mvpp[CHANNELS]; /* 0 for a silent channel */
    uint32_t slot;
    bool is_cut;
};

struct device {
    uint64_t boot_id;
    uint32_t sample_rate_mhz;
    enum state state;
    uint64_t now_us;
    uint64_t beat_us;
    uint64_t armed; /* token, 0: none */
    uint64_t armed_until_us;
    uint32_t armed_slot;
    uint32_t levels_mvpp[CHANNELS];
    struct burst last; /* token 0: none yet */
    uint64_t measured_token;
    struct measured measured;
    bool is_measuring; /* MEASURED of the last burst is not known yet */
    uint8_t known; /* bits of `health` */
    uint8_t set;
    enum refusal off_reason; /* of the steps that are illegal in STATE_SAFE */
    /* The memory behind exactly-once. The danger is not to forget but to say "never armed" of what
     * was forgotten: a burst that was felt would be presented again. Up to the largest token ever
     * dropped absence means nothing; hosts count upwards, so that theirs lie above it. */
    struct record records[HISTORY];
    size_t next_record;
    uint64_t dropped_up_to;
    struct slot slots[SLOTS];
    int16_t memory[CHANNELS * MEMORY_SAMPLES];
};

/* Switch on: everything forgotten. The device must be zeroed memory. */
void device_init(struct device *device, uint64_t boot_id, uint32_t sample_rate_mhz);

/* Let happen what was due: end of a burst, end of a time to live, watchdog. */
void device_advance(struct device *device, uint64_t now_us);

/* Take what switch and amplifier report, whenever that changes; over-current stops. */
void device_sense(struct device *device, uint8_t known, uint8_t set);

/* Have MEASURED of the burst that has ended wait, for as long as `is_measuring`: until
 * `device_measure` tells it, or its codes make room for others. */
void device_begin_measuring(struct device *device);
void device_measure(struct device *device, const struct measured *measured);

/* The steps. */
enum refusal device_check_room(const struct device *device, uint32_t slot, uint32_t samples);
enum refusal device_load(struct device *device, uint32_t slot, uint32_t samples,
                         const uint8_t *codes);
enum refusal device_set_levels(struct device *device, const uint32_t levels_mvpp[CHANNELS]);
enum refusal device_enable(struct device *device);
enum refusal device_arm(struct device *device, uint64_t token, uint32_t slot,
                        uint32_t time_to_live_us);
enum refusal device_fire(struct device *device, uint64_t token);
void device_disarm(struct device *device, uint64_t token);
struct record device_query(const struct device *device, uint64_t token);
enum refusal device_measured(const struct device *device, uint64_t token,
                             struct measured *measured);
void device_stop(struct device *device);

/* Stop because the line to the host is gone. */
void device_lose_line(struct device *device);
void device_hear(struct device *device);

/* Whether outputs and amplifier are on. */
bool device_is_on(const struct device *device);

/* The code for the converter: a sample of a burst at its level, rounded toward zero. */
int32_t device_step(const struct device *device, const struct burst *burst, uint32_t channel,
                    uint32_t sample);

#endif

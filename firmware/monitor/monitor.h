/* What an input saw of a burst, matched against what was to be played; in whole numbers, and a
 * slice at a time, so that the loop is never held for long. */
#ifndef MONITOR_H
#define MONITOR_H

#include "../core/device.h"

#include <stdbool.h>
#include <stdint.h>

#ifndef MONITOR_TAP
#define MONITOR_TAP TAP_AMPLIFIER
#endif
#ifndef MONITOR_UV_PER_COUNT
#define MONITOR_UV_PER_COUNT 80566U /* at the actuator: 3.3 V / 4096 behind a divider by 100 */
#endif
#ifndef SLICE
#define SLICE 4096U /* samples that a step looks at; README.md has how long that takes */
#endif
#define LAGS 48U /* samples by which a burst may come late: 1 ms at 48 kHz */

enum look { LOOK_REST, LOOK_PEAK, LOOK_LAG, LOOK_SQUARES, LOOKS };

/* What has been found of one channel. */
struct match {
    int64_t sum;
    int32_t rest; /* of the input, without a burst */
    uint32_t peak;
    int64_t product;    /* with the burst at this lag, */
    int64_t best;       /* and where both channels fit best */
    uint64_t planned_2; /* sums of squares there */
    uint64_t seen_2;
};

struct monitor {
    const int16_t *codes;
    const uint32_t *recorded;
    uint32_t samples;
    uint32_t count;
    enum look look;
    uint32_t channel;
    uint32_t at;
    uint32_t lag;
    uint32_t best_lag;
    struct match matches[CHANNELS];
};

/* Begin to match a recording against the codes of a burst, left then right, `samples` each.
 *
 * A word of the recording has the left channel in its lower and the right in its upper half; its
 * first was taken with the burst's first sample, `count` is at least `samples`. */
void monitor_begin(struct monitor *monitor, const int16_t *codes, uint32_t samples,
                   const uint32_t *recorded, uint32_t count);

/* Look at the next slice; return whether that was the last. */
bool monitor_step(struct monitor *monitor);

/* Tell what was found; a channel that was to be silent has the correlation 0. */
void monitor_tell(const struct monitor *monitor, uint32_t sample_rate_mhz,
                  struct measured *measured);

#endif

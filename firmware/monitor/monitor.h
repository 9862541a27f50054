/* What an input saw of a burst, matched against what was to be played; in whole numbers. */
#ifndef MONITOR_H
#define MONITOR_H

#include "../core/device.h"

#include <stdint.h>

#ifndef MONITOR_TAP
#define MONITOR_TAP TAP_AMPLIFIER
#endif
#ifndef MONITOR_UV_PER_COUNT
#define MONITOR_UV_PER_COUNT 80566U /* at the actuator: 3.3 V / 4096 behind a divider by 100 */
#endif
#define LAGS 48U /* samples by which a burst may come late: 1 ms at 48 kHz */

/* Match a recording against the codes of a burst, left then right, `samples` each.
 *
 * A word of the recording has the left channel in its lower and the right in its upper half; its
 * first was taken with the burst's first sample, `count` is at least `samples`. A channel that was
 * to be silent has the correlation 0. */
void monitor_measure(const int16_t *codes, uint32_t samples, const uint32_t *recorded,
                     uint32_t count, uint32_t sample_rate_mhz, struct measured *measured);

#endif

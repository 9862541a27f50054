/* What this device may do, compiled in: no message changes it (docs/protocol.md, Limits).
 *
 * A board defines what differs from the emulator on the compiler's command line. Whole numbers
 * only: host, emulator and firmware come to the same verdict to the last bit.
 */
#ifndef LIMITS_H
#define LIMITS_H

#include <assert.h>
#include <stdint.h>

#ifndef CEILING_MVPP
#define CEILING_MVPP 200000U /* at the actuator */
#endif
#ifndef RAIL_MVPP
#define RAIL_MVPP CEILING_MVPP /* at the actuator, of the converter's full scale to both sides */
#endif
#ifndef LEAST_INTERVAL_US
#define LEAST_INTERVAL_US 10000U /* from the end of a burst to the next onset */
#endif
#ifndef MAX_DUTY_PPM
#define MAX_DUTY_PPM 500000U
#endif
#ifndef DC_TOLERANCE_PPM
#define DC_TOLERANCE_PPM 10000U
#endif
#ifndef LONGEST_TIME_TO_LIVE_US
#define LONGEST_TIME_TO_LIVE_US 10000000U
#endif
#ifndef BITS
#define BITS 16U /* of the converter */
#endif
#ifndef SLOTS
#define SLOTS 8U
#endif
#ifndef LONGEST_WAVEFORM
#define LONGEST_WAVEFORM 16384U /* in samples of one channel */
#endif
#ifndef MEMORY_SAMPLES
#define MEMORY_SAMPLES (2U * LONGEST_WAVEFORM) /* of one channel, over all slots */
#endif
#ifndef HISTORY
#define HISTORY 1024U /* tokens remembered: exactly once reaches back as far */
#endif
#ifndef DATA_WINDOW
#define DATA_WINDOW 8U /* DATA that may be on their way unanswered */
#endif

/* Five beats may be lost before the outputs go off, so that a busy host is not taken for a dead
 * one; longer must no actuator be driven that nobody watches. */
#define WATCHDOG_US 500000U

#define FULL_SCALE ((1U << (BITS - 1U)) - 1U)
#define CHANNELS 2U

static_assert(CEILING_MVPP >= 1U && CEILING_MVPP <= RAIL_MVPP, "full scale reaches the ceiling");
static_assert(RAIL_MVPP <= UINT32_MAX, "levels travel in 32 bits");
static_assert(DC_TOLERANCE_PPM >= 1U && DC_TOLERANCE_PPM <= 1000000U, "a ratio");
static_assert(MAX_DUTY_PPM >= 1U && MAX_DUTY_PPM <= 1000000U, "a ratio");
static_assert(BITS >= 2U && BITS <= 16U, "codes travel and are stored in 16 bits");
static_assert(SLOTS >= 1U && SLOTS <= 255U, "how many there are is told in one byte");
static_assert(DATA_WINDOW >= 1U && DATA_WINDOW <= 255U,
              "how many there are is told in one byte");
static_assert(HISTORY >= 1U, "the last token is remembered");
static_assert(LONGEST_WAVEFORM >= 1U && LONGEST_WAVEFORM <= 65536U,
              "a correlation of codes fits 64 bits");
static_assert(MEMORY_SAMPLES >= LONGEST_WAVEFORM, "one waveform of the longest has room");

#endif

/* What must hold of what a device may do, which is compiled in: no message changes it
 * (docs/protocol.md, Limits; hal/limits.h has the numbers). Whole numbers only: host, emulator and
 * firmware come to the same verdict to the last bit.
 */
#ifndef LIMITS_H
#define LIMITS_H

#include <assert.h>
#include <stdint.h>

/* Five beats may be lost before the outputs go off, so that a busy host is not taken for a dead
 * one; longer must no actuator be driven that nobody watches. */
#define WATCHDOG_US 500000U

#define FULL_SCALE ((1U << (BITS - 1U)) - 1U)

static_assert(CEILING_MVPP >= 1U && CEILING_MVPP <= RAIL_MVPP, "full scale reaches the ceiling");
static_assert(RAIL_MVPP <= UINT32_MAX, "levels travel in 32 bits");
static_assert(DC_TOLERANCE_PPM >= 1U && DC_TOLERANCE_PPM <= 1000000U, "a ratio");
static_assert(MAX_DUTY_PPM >= 1U && MAX_DUTY_PPM <= 1000000U, "a ratio");
static_assert(BITS >= 2U && BITS <= 16U, "codes travel and are stored in 16 bits");
static_assert(SLOTS >= 1U && SLOTS <= 255U, "how many there are is told in one byte");
static_assert(HISTORY >= 1U, "the last token is remembered");
static_assert(LONGEST_WAVEFORM >= 1U && LONGEST_WAVEFORM <= 65536U,
              "a correlation of codes fits 64 bits");
static_assert(MEMORY_SAMPLES >= LONGEST_WAVEFORM, "one waveform of the longest has room");

#endif

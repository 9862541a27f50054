#include "monitor.h"

#include <string.h>

#define HALF_WORD 16U
#define UNITY 10000U /* of a correlation */

struct match {
    int32_t offset; /* of the input at rest */
    uint32_t peak;
    uint64_t planned_2; /* sum of squares */
};

static int32_t sample_of(uint32_t word, uint32_t channel) {
    return (int32_t)((word >> (channel * HALF_WORD)) & 0xFFFFU);
}

/* Root rounded down, a bit at a time. */
static uint64_t root(uint64_t square) {
    uint64_t found = 0;
    for (uint32_t bit = 31U; bit < 32U; bit--) {
        const uint64_t tried = found | (1ULL << bit);
        if (tried * tried <= square) {
            found = tried;
        }
    }
    return found;
}

/* A burst has no DC part: the mean of all that was recorded is where the input rests. */
static void look_at(struct match *match, const int16_t *codes, uint32_t samples,
                    const uint32_t *recorded, uint32_t count, uint32_t channel) {
    int64_t sum = 0;
    *match = (struct match){0};
    for (uint32_t i = 0; i < count; i++) {
        sum += sample_of(recorded[i], channel);
    }
    match->offset = (int32_t)((sum + (int64_t)count / 2) / (int64_t)count);
    for (uint32_t i = 0; i < count; i++) {
        const int32_t away = sample_of(recorded[i], channel) - match->offset;
        const uint32_t magnitude = (uint32_t)(away < 0 ? -away : away);
        match->peak = magnitude > match->peak ? magnitude : match->peak;
    }
    for (uint32_t i = 0; i < samples; i++) {
        match->planned_2 += (uint64_t)((int64_t)codes[i] * codes[i]);
    }
}

static int64_t product_at(const struct match *match, const int16_t *codes, uint32_t samples,
                          const uint32_t *recorded, uint32_t channel, uint32_t lag) {
    int64_t sum = 0;
    for (uint32_t i = 0; i < samples; i++) {
        sum += (int64_t)codes[i] * (sample_of(recorded[i + lag], channel) - match->offset);
    }
    return sum;
}

/* The correlation where the burst was found; 8 bits are kept behind the point of each root. */
static uint16_t correlation_at(const struct match *match, const int16_t *codes, uint32_t samples,
                               const uint32_t *recorded, uint32_t channel, uint32_t lag) {
    const int64_t product = product_at(match, codes, samples, recorded, channel, lag);
    uint64_t seen_2 = 0;
    for (uint32_t i = 0; i < samples; i++) {
        const int64_t away = sample_of(recorded[i + lag], channel) - match->offset;
        seen_2 += (uint64_t)(away * away);
    }
    const uint64_t norm = root(match->planned_2 << 16U) * root(seen_2 << 16U);
    if (product <= 0 || norm == 0U) {
        return 0;
    }
    const uint64_t found = ((uint64_t)product * UNITY << 8U) / ((norm >> 8U) + 1U);
    return (uint16_t)(found > UNITY ? UNITY : found);
}

static uint32_t millivolts(uint32_t counts) {
    return (uint32_t)(((uint64_t)counts * MONITOR_UV_PER_COUNT + 500U) / 1000U);
}

void monitor_measure(const int16_t *codes, uint32_t samples, const uint32_t *recorded,
                     uint32_t count, uint32_t sample_rate_mhz, struct measured *measured) {
    struct match left;
    struct match right;
    const int16_t *right_codes = &codes[samples];
    look_at(&left, codes, samples, recorded, count, 0);
    look_at(&right, right_codes, samples, recorded, count, 1);
    const uint32_t room = count - samples;
    uint32_t best_lag = 0;
    int64_t best = 0;
    for (uint32_t lag = 0; lag <= room && lag < LAGS; lag++) {
        const int64_t both = product_at(&left, codes, samples, recorded, 0, lag) +
                             product_at(&right, right_codes, samples, recorded, 1, lag);
        if (both > best) {
            best = both;
            best_lag = lag;
        }
    }
    const uint64_t period_1e9 = 1000000000ULL;
    memset(measured, 0, sizeof(*measured));
    measured->tap = (uint8_t)MONITOR_TAP;
    measured->unit = (uint8_t)UNIT_MILLIVOLT;
    measured->left = millivolts(left.peak);
    measured->right = millivolts(right.peak);
    measured->onset_us = (uint32_t)(best_lag * period_1e9 / sample_rate_mhz);
    measured->uncertainty_us =
        (uint32_t)((period_1e9 + sample_rate_mhz - 1U) / sample_rate_mhz);
    measured->correlation_left = correlation_at(&left, codes, samples, recorded, 0, best_lag);
    measured->correlation_right =
        correlation_at(&right, right_codes, samples, recorded, 1, best_lag);
}

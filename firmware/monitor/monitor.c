#include "monitor.h"

#include <string.h>

#define HALF_WORD 16U
#define UNITY 10000U /* of a correlation */

void monitor_begin(struct monitor *monitor, const int16_t *codes, uint32_t samples,
                   const uint32_t *recorded, uint32_t count) {
    *monitor = (struct monitor){
        .codes = codes, .recorded = recorded, .samples = samples, .count = count};
}

/* A sample of one channel of a recording. */
static int32_t sample_of(uint32_t word, uint32_t channel) {
    return (int32_t)((word >> (channel * HALF_WORD)) & 0xFFFFU);
}

static void add_rest(const struct monitor *monitor, struct match *match, uint32_t from,
                     uint32_t to) {
    for (uint32_t i = from; i < to; i++) {
        match->sum += sample_of(monitor->recorded[i], monitor->channel);
    }
}

static void add_peak(const struct monitor *monitor, struct match *match, uint32_t from,
                     uint32_t to) {
    for (uint32_t i = from; i < to; i++) {
        const int32_t away = sample_of(monitor->recorded[i], monitor->channel) - match->rest;
        const uint32_t magnitude = (uint32_t)(away < 0 ? -away : away);
        match->peak = magnitude > match->peak ? magnitude : match->peak;
    }
}

/* Nearly all of the time is spent here; sums are kept in registers. */
static void add_product(const struct monitor *monitor, struct match *match, uint32_t from,
                        uint32_t to) {
    const uint32_t channel = monitor->channel;
    const int16_t *codes = &monitor->codes[channel * monitor->samples];
    const uint32_t *words = &monitor->recorded[monitor->lag];
    const int32_t rest = match->rest;
    int64_t product = match->product;
    for (uint32_t i = from; i < to; i++) {
        product += (int64_t)codes[i] * (sample_of(words[i], channel) - rest);
    }
    match->product = product;
}

static void add_squares(const struct monitor *monitor, struct match *match, uint32_t from,
                        uint32_t to) {
    const uint32_t channel = monitor->channel;
    const int16_t *codes = &monitor->codes[channel * monitor->samples];
    const uint32_t *words = &monitor->recorded[monitor->best_lag];
    const int32_t rest = match->rest;
    uint64_t planned_2 = match->planned_2;
    uint64_t seen_2 = match->seen_2;
    for (uint32_t i = from; i < to; i++) {
        const int64_t away = sample_of(words[i], channel) - rest;
        planned_2 += (uint64_t)((int64_t)codes[i] * codes[i]);
        seen_2 += (uint64_t)(away * away);
    }
    match->planned_2 = planned_2;
    match->seen_2 = seen_2;
}

/* What is looked at, one after the other; the first two in all that was recorded. */
static void (*const looks[LOOKS])(const struct monitor *, struct match *, uint32_t, uint32_t) = {
    [LOOK_REST] = add_rest,
    [LOOK_PEAK] = add_peak,
    [LOOK_LAG] = add_product,
    [LOOK_SQUARES] = add_squares,
};

/* Compare a lag with the best before it; return whether it was the last. */
static bool end_lag(struct monitor *monitor) {
    struct match *left = &monitor->matches[0];
    struct match *right = &monitor->matches[1];
    const int64_t best = left->best + right->best;
    if (monitor->lag == 0U || left->product + right->product > (best > 0 ? best : 0)) {
        left->best = left->product;
        right->best = right->product;
        monitor->best_lag = monitor->lag;
    }
    left->product = 0;
    right->product = 0;
    monitor->lag++;
    return monitor->lag > LAGS || monitor->lag > monitor->count - monitor->samples;
}

/* Go on, once all samples of a channel were looked at, with the other or with what comes next.
 *
 * A burst has no DC part: the mean of all that was recorded is where the input rests. */
static void end_look(struct monitor *monitor) {
    struct match *match = &monitor->matches[monitor->channel];
    if (monitor->look == LOOK_REST) {
        const int64_t count = monitor->count;
        match->rest = (int32_t)((match->sum + count / 2) / count);
    }
    monitor->at = 0;
    monitor->channel = 1U - monitor->channel;
    if (monitor->channel == 0U && (monitor->look != LOOK_LAG || end_lag(monitor))) {
        monitor->look = (enum look)(monitor->look + 1);
    }
}

bool monitor_step(struct monitor *monitor) {
    uint32_t left = SLICE;
    while (left > 0U && monitor->look != LOOKS) {
        const uint32_t size = monitor->look <= LOOK_PEAK ? monitor->count : monitor->samples;
        const uint32_t missing = size - monitor->at;
        const uint32_t now = missing < left ? missing : left;
        looks[monitor->look](monitor, &monitor->matches[monitor->channel], monitor->at,
                             monitor->at + now);
        monitor->at += now;
        left -= now;
        if (now == missing) {
            end_look(monitor);
        }
    }
    return monitor->look == LOOKS;
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

/* The correlation where the burst was found; 8 bits are kept behind the point of each root. */
static uint16_t correlation_of(const struct match *match) {
    const uint64_t norm = root(match->planned_2 << 16U) * root(match->seen_2 << 16U);
    if (match->best <= 0 || norm == 0U) {
        return 0;
    }
    const uint64_t found = ((uint64_t)match->best * UNITY << 8U) / ((norm >> 8U) + 1U);
    return (uint16_t)(found > UNITY ? UNITY : found);
}

static uint32_t millivolts(uint32_t counts) {
    return (uint32_t)(((uint64_t)counts * MONITOR_UV_PER_COUNT + 500U) / 1000U);
}

void monitor_tell(const struct monitor *monitor, uint32_t sample_rate_mhz,
                  struct measured *measured) {
    const uint64_t period_1e9 = 1000000000ULL;
    const uint64_t late = monitor->best_lag;
    memset(measured, 0, sizeof(*measured));
    measured->tap = (uint8_t)MONITOR_TAP;
    measured->onset_us = (uint32_t)(late * period_1e9 / sample_rate_mhz);
    measured->uncertainty_us =
        (uint32_t)((period_1e9 + sample_rate_mhz - 1U) / sample_rate_mhz);
    for (uint32_t i = 0; i < CHANNELS; i++) {
        measured->peaks[i] = millivolts(monitor->matches[i].peak);
        measured->correlations[i] = correlation_of(&monitor->matches[i]);
    }
}

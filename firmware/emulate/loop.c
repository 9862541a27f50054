#include "loop.h"

#define MIDDLE 2048LL /* where the inputs rest */
#define MOST_COUNTS 4095
#define HALF_WORD 16U
#define MILLION 1000000

/* About normal: the sum of four numbers of 16 bits has a spread of 37837. By xorshift (Marsaglia
 * 2003). */
static int64_t noise_uv(struct loop *loop) {
    loop->random ^= loop->random << 13;
    loop->random ^= loop->random >> 7;
    loop->random ^= loop->random << 17;
    int64_t sum = -4 * 0x8000;
    for (uint32_t shift = 0; shift < 64U; shift += 16U) {
        sum += (int64_t)((loop->random >> shift) & 0xFFFFU);
    }
    return sum * 1000 * loop->noise_mv / 37837;
}

static uint32_t counts_of(struct loop *loop, int32_t step) {
    int64_t uv = (int64_t)step * RAIL_MVPP * 500 / (int64_t)FULL_SCALE;
    uv = uv * loop->gain_ppm / MILLION + noise_uv(loop);
    const int64_t per_count = (int64_t)MONITOR_UV_PER_COUNT;
    const int64_t counts = (uv + MIDDLE * per_count + per_count / 2) / per_count;
    return (uint32_t)(counts < 0 ? 0 : (counts > MOST_COUNTS ? MOST_COUNTS : counts));
}

bool loop_record(struct loop *loop, const struct device *device) {
    const struct burst *burst = &device->last;
    const struct slot *slot = &device->slots[burst->slot];
    if (device->state == STATE_FIRED || burst->is_cut || loop->gain_ppm == 0U) {
        return false;
    }
    const uint64_t late = (uint64_t)loop->delay_us * device->sample_rate_mhz / 1000000000U;
    loop->token = burst->token;
    loop->random |= 1U; /* it never leaves zero */
    for (uint32_t i = 0; i < slot->samples + LAGS; i++) {
        uint32_t word = 0;
        for (uint32_t channel = 0; channel < CHANNELS; channel++) {
            int32_t step = 0;
            if (!loop->is_open && i >= late && i - late < slot->samples) {
                step = device_step(device, burst, channel, i - (uint32_t)late);
            }
            word |= counts_of(loop, step) << (channel * HALF_WORD);
        }
        loop->recorded[i] = word;
    }
    monitor_begin(&loop->monitor, &device->memory[slot->begin], slot->samples, loop->recorded,
                  slot->samples + LAGS);
    return true;
}

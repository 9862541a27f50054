/* The device as a shared library, for a host that has its lines, its clock and its amplifier:
 * device/emulate/firmware.py, which calls functions of core/ and monitor/ too. The memory is the
 * caller's, so that a process can have several devices. */
#include "../core/endpoint.h"

const uint32_t library_bits = BITS;
const uint32_t library_ceiling_mvpp = CEILING_MVPP;
const uint32_t library_rail_mvpp = RAIL_MVPP;

/* Bytes of zeroed memory that `endpoint_init` needs. */
size_t library_size(void) { return sizeof(struct endpoint); }

struct device *library_device(struct endpoint *endpoint) { return &endpoint->device; }

uint32_t library_state(const struct device *device) { return (uint32_t)device->state; }

const struct burst *library_last_burst(const struct device *device) { return &device->last; }

/* Take bytes up to the first that is answered; return how many. */
size_t library_receive(struct endpoint *endpoint, const uint8_t *bytes, size_t size,
                       uint8_t answer[LONGEST_ANSWER], size_t *answer_size) {
    size_t taken = 0;
    *answer_size = 0;
    while (taken < size && *answer_size == 0U) {
        *answer_size = endpoint_receive(endpoint, bytes[taken], answer);
        taken++;
    }
    return taken;
}

/* Samples of one channel of the last burst. */
size_t library_samples(const struct device *device) {
    return device->slots[device->last.slot].samples;
}

/* Write the steps that the converter plays in the last burst: all of left, then of right. */
void library_render(const struct device *device, int32_t *steps) {
    const uint32_t samples = device->slots[device->last.slot].samples;
    for (uint32_t channel = 0; channel < CHANNELS; channel++) {
        for (uint32_t i = 0; i < samples; i++) {
            steps[channel * samples + i] = device_step(device, &device->last, channel, i);
        }
    }
}

/* What comes back of a burst where no actuator is: the inputs of a board, without the board.
 *
 * It comes by gain, late and in noise, through 12 bits as on the board, and is matched by the
 * board's monitor. While the amplifier's switch is open there is only noise. */
#ifndef LOOP_H
#define LOOP_H

#include "../monitor/monitor.h"

#include <stdbool.h>
#include <stdint.h>

struct loop {
    uint32_t gain_ppm; /* 0: nothing is wired, and nothing measured */
    uint32_t delay_us;
    uint32_t noise_mv; /* effective value, at the actuator */
    bool is_open;      /* the amplifier's switch */
    uint64_t random;
    uint64_t token; /* of the burst that was recorded last */
    uint32_t recorded[LONGEST_WAVEFORM + LAGS];
    struct monitor monitor;
};

/* Record the last burst and begin to match it, if it has ended and anything is wired. */
bool loop_record(struct loop *loop, const struct device *device);

#endif

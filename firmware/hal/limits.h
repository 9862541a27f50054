/* What a device may do: as the emulator, unless a board's own limits.h or DEFINES says otherwise.
 *
 * Included before all else that is compiled; core/limits.h has what must hold of them. */
#ifndef HAL_LIMITS_H
#define HAL_LIMITS_H

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

#endif

/* What this board may do; DEFINES overrides these too. */
#ifndef NUCLEO_LIMITS_H
#define NUCLEO_LIMITS_H

#ifndef BITS
#define BITS 12U
#endif
#ifndef LONGEST_WAVEFORM
#define LONGEST_WAVEFORM 4096U /* 85 ms */
#endif
#ifndef RAIL_MVPP
#define RAIL_MVPP 230000U /* the pins reach 7/8 of the full scale: converter.c */
#endif

#include "../limits.h"

#endif

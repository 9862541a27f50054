/* Two converters on one timer, fed by DMA, and two inputs that look at what comes of it. */
#ifndef CONVERTER_H
#define CONVERTER_H

#include "../../core/device.h"

#include <stdbool.h>
#include <stdint.h>

void converter_init(void);

/* Get the beginning of a burst ready, so that its start takes no time. */
void converter_prepare(const struct device *device, const struct burst *burst);

/* Start what was prepared. */
void converter_start(void);

/* Whether a converter asked for a sample that did not come: from then on it asks no more. */
bool converter_underran(void);

/* Outputs to zero, now. */
void converter_stop(void);

/* Wait, for a millisecond, until the recording of a burst is whole whose last sample was played;
 * return how many words of `monitor_measure` it has. */
uint32_t converter_recorded(const uint32_t **words);

#endif

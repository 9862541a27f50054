/* Two converters on one timer, fed by DMA, and two inputs that look at what comes of it. */
#ifndef CONVERTER_H
#define CONVERTER_H

#include "../../core/device.h"

#include <stdbool.h>
#include <stdint.h>

void converter_init(void);

/* The DMA has played half of what it has. */
void dma1_channel1_handler(void);

/* Get the beginning of a burst ready, so that its start takes no time. */
void converter_prepare(const struct device *device, const struct burst *burst);

/* Start what was prepared. */
void converter_start(void);

/* Whether a converter asked for a sample that did not come: from then on it asks no more. */
bool converter_underran(void);

/* Outputs to zero, now. */
void converter_stop(void);

/* Whether the recording of a burst is whole: a millisecond after its last sample. */
bool converter_is_recorded(void);

/* Return how many words for `monitor_begin` there are. */
uint32_t converter_recorded(const uint32_t **words);

#endif

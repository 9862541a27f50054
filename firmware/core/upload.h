/* A waveform on the wire: in pieces, in any order, stored only if it arrived whole. */
#ifndef UPLOAD_H
#define UPLOAD_H

#include "device.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define LONGEST_DATA 32U /* bytes of a piece: longer frames seldom survive a bad line */
#define LONGEST_UPLOAD (2U * CHANNELS * LONGEST_WAVEFORM)
#define PIECES ((LONGEST_UPLOAD + LONGEST_DATA - 1U) / LONGEST_DATA)

struct upload {
    bool is_under_way;
    uint16_t number; /* of its BEGIN */
    uint32_t slot;
    uint32_t samples;
    uint32_t size;
    uint32_t missing; /* pieces */
    uint8_t came[(PIECES + 7U) / 8U];
    uint8_t bytes[LONGEST_UPLOAD];
};

enum refusal upload_begin(struct upload *upload, const struct device *device, uint16_t number,
                          uint32_t slot, uint32_t samples);
enum refusal upload_add(struct upload *upload, uint16_t number, uint32_t offset,
                        const uint8_t *octets, size_t size);

/* Store the waveform if all of it came and has this checksum; the upload is over in any case. */
enum refusal upload_finish(struct upload *upload, struct device *device, uint32_t slot,
                           uint32_t crc);

#endif

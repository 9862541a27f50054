/* The device's end of the wire: bytes in, bytes out, around the device's logic; without I/O.
 *
 * What a HAL does, and nothing else, over and over:
 *
 *     device_advance(device, now)      and device_sense where switch or amplifier report a change
 *     device_measure(device, ...)      where a burst has ended that a monitor saw, or
 *                                      device_begin_measuring, and this when that is done
 *     endpoint_receive(..., byte, answer) for a byte that arrived
 *     drive the converter by the state and `last`, the amplifier's enable by device_is_on
 *     send the answer
 *
 * in this order, so that no answer tells of a burst that has not begun.
 */
#ifndef ENDPOINT_H
#define ENDPOINT_H

#include "device.h"
#include "frames.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define GREETINGS 16U
#define NAME_SIZE 16U
#define FIRMWARE_SIZE 32U
#define LONGEST_ANSWER LONGEST_FRAME
#define LONGEST_DATA 32U /* bytes of a piece: longer frames seldom survive a bad line */
#define LONGEST_UPLOAD (2U * CHANNELS * LONGEST_WAVEFORM)
#define PIECES ((LONGEST_UPLOAD + LONGEST_DATA - 1U) / LONGEST_DATA)

/* What a device says of itself; texts are filled up with zeros. */
struct about {
    char model[NAME_SIZE];
    char serial_number[NAME_SIZE];
    char firmware[FIRMWARE_SIZE];
    uint64_t boot_id;
    uint32_t sample_rate_mhz;
    enum entropy entropy;
    bool emulated;
};

/* A waveform on the wire: in pieces, in any order, stored only if it arrived whole. */
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

struct endpoint {
    struct about about;
    struct decoder decoder;
    uint64_t greetings[GREETINGS]; /* nonces */
    size_t n_greetings;
    bool has_newest;
    uint16_t newest;
    struct frame last_question; /* in order, of this connection */
    size_t last_size;           /* 0: none yet */
    uint8_t last_answer[LONGEST_ANSWER];
    struct upload upload;
    struct device device;
};

/* Switch on. The endpoint must be zeroed memory. */
void endpoint_init(struct endpoint *endpoint, const struct about *about);

/* Take a byte; return how many bytes are to be sent back. */
size_t endpoint_receive(struct endpoint *endpoint, uint8_t byte, uint8_t answer[LONGEST_ANSWER]);

/* Notice that the line is gone: the outputs go to zero. */
void endpoint_hang_up(struct endpoint *endpoint);

#endif

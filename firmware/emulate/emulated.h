/* A device without an actuator: the device's end of the wire, and the truth of what it emitted.
 *
 * The lines are those of `tactstrip emulate --truth`, with the volts of each burst. For HALs that
 * have no converter: they implement `truth_put` and `complain`.
 */
#ifndef EMULATED_H
#define EMULATED_H

#include "../core/endpoint.h"
#include "loop.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define LONGEST_WORD 32U

struct emulated {
    struct endpoint endpoint;
    bool was_on;
    uint64_t noted; /* token of the burst whose line was written last */
    bool noted_cut;
    struct loop loop;
    bool senses; /* the amplifier's switch is wired to the device */
    char word[LONGEST_WORD]; /* that comes; of a longer one its beginning */
    size_t word_size;
};

/* Append to the file of truth. */
void truth_put(const char *text, size_t size);

/* Tell somebody, on standard error, that what he wrote is not understood. */
void complain(const char *text, size_t size);

/* Switch on. It must be zeroed memory, but for what `loop` is told and whether it senses. */
void emulated_init(struct emulated *emulated, const struct about *about, uint64_t began_us);

/* Move the amplifier's switch by a byte of what somebody writes: lines `open` and `closed`. */
void emulated_hear(struct emulated *emulated, uint64_t now_us, char byte);

/* Let happen what is due: every few milliseconds, and where a byte or a word comes. */
void emulated_advance(struct emulated *emulated, uint64_t now_us);
size_t emulated_receive(struct emulated *emulated, uint64_t now_us, uint8_t byte,
                        uint8_t answer[LONGEST_ANSWER]);
void emulated_hang_up(struct emulated *emulated, uint64_t now_us, const char *cause);

/* Match the next slice of what came back of a burst; in each turn of a loop, whatever arrives. */
void emulated_measure(struct emulated *emulated);

#endif

/* A device without an actuator: the device's end of the wire, and the truth of what it emitted.
 *
 * The lines are those of `tactstrip emulate --truth`, with the volts of each burst. For HALs that
 * have no converter: they implement `truth_put`.
 */
#ifndef EMULATED_H
#define EMULATED_H

#include "../core/endpoint.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct emulated {
    struct endpoint endpoint;
    bool was_on;
    uint64_t noted; /* token of the burst whose line was written last */
    bool noted_cut;
};

/* Append to the file of truth. */
void truth_put(const char *text, size_t size);

void emulated_init(struct emulated *emulated, const struct about *about, uint64_t began_us);

/* Let happen what is due; to be called at the time of each receipt, and every few milliseconds. */
void emulated_advance(struct emulated *emulated, uint64_t now_us);
size_t emulated_receive(struct emulated *emulated, uint64_t now_us, uint8_t byte,
                        uint8_t answer[LONGEST_ANSWER]);
void emulated_hang_up(struct emulated *emulated, uint64_t now_us, const char *cause);

#endif

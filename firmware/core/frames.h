/* Frames of the wire format: bytes to messages and back, whatever the bytes are.
 *
 *     0x00  COBS( version | type | sequence | payload | CRC-32 )  0x00
 */
#ifndef FRAMES_H
#define FRAMES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define VERSION 2U
#define MINOR 0U
#define ANSWER 0x80U
#define LONGEST_PAYLOAD 96U
#define SHORTEST_BODY 8U
#define LONGEST_BODY (SHORTEST_BODY + LONGEST_PAYLOAD)
#define LONGEST_CODED (LONGEST_BODY + 1U) /* COBS adds one byte to fewer than 255 */
#define LONGEST_FRAME (LONGEST_CODED + 2U)

struct frame {
    uint8_t kind;
    uint16_t sequence;
    size_t size;
    uint8_t payload[LONGEST_PAYLOAD];
};

/* Frames out of a stream that may hold anything; in between, `*IDN?` where everything since the
 * last delimiter is text. Of what is too long to be a frame one byte too many is kept. */
struct decoder {
    uint8_t piece[LONGEST_CODED + 1U];
    size_t size;
    bool is_binary;
    size_t matched; /* bytes of the question */
};

/* What a byte completes. */
enum received { NOTHING, FRAME, IDENTITY };

uint16_t read_u16(const uint8_t *at);
uint32_t read_u32(const uint8_t *at);
uint64_t read_u64(const uint8_t *at);
uint8_t *write_u8(uint8_t *at, uint32_t value);
uint8_t *write_u16(uint8_t *at, uint32_t value);
uint8_t *write_u32(uint8_t *at, uint32_t value);
uint8_t *write_u64(uint8_t *at, uint64_t value);

/* Return the checksum of bytes that follow others with the checksum `crc`, 0 if there are none. */
uint32_t crc32(uint32_t crc, const uint8_t *bytes, size_t size);

/* Return the number of bytes of the coded frame, delimiters included. */
size_t frame_encode(const struct frame *frame, uint8_t coded[LONGEST_FRAME]);

/* Take a byte; a frame that it completes is then in `frame`. */
enum received decoder_feed(struct decoder *decoder, uint8_t byte, struct frame *frame);

#endif

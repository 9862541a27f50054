#include "frames.h"

#include <string.h>

#define CRC_SIZE 4U

uint16_t read_u16(const uint8_t *at) { return (uint16_t)(at[0] | ((uint32_t)at[1] << 8)); }

uint32_t read_u32(const uint8_t *at) {
    return (uint32_t)read_u16(at) | ((uint32_t)read_u16(at + 2) << 16);
}

uint64_t read_u64(const uint8_t *at) {
    return (uint64_t)read_u32(at) | ((uint64_t)read_u32(at + 4) << 32);
}

uint8_t *write_u8(uint8_t *at, uint32_t value) {
    at[0] = (uint8_t)(value & 0xFFU);
    return at + 1;
}

uint8_t *write_u16(uint8_t *at, uint32_t value) {
    return write_u8(write_u8(at, value), value >> 8);
}

uint8_t *write_u32(uint8_t *at, uint32_t value) {
    return write_u16(write_u16(at, value), value >> 16);
}

uint8_t *write_u64(uint8_t *at, uint64_t value) {
    return write_u32(write_u32(at, (uint32_t)(value & 0xFFFFFFFFU)), (uint32_t)(value >> 32));
}

/* The CRC of zlib and Ethernet. Half a byte at a time: 64 bytes of table are enough for waveforms
 * of some thousand samples. */
uint32_t crc32(uint32_t crc, const uint8_t *bytes, size_t size) {
    static const uint32_t table[16] = {
        0x00000000U, 0x1DB71064U, 0x3B6E20C8U, 0x26D930ACU, 0x76DC4190U, 0x6B6B51F4U,
        0x4DB26158U, 0x5005713CU, 0xEDB88320U, 0xF00F9344U, 0xD6D6A3E8U, 0xCB61B38CU,
        0x9B64C2B0U, 0x86D3D2D4U, 0xA00AE278U, 0xBDBDF21CU,
    };
    crc ^= 0xFFFFFFFFU;
    for (size_t i = 0; i < size; i++) {
        crc ^= bytes[i];
        crc = (crc >> 4) ^ table[crc & 0xFU];
        crc = (crc >> 4) ^ table[crc & 0xFU];
    }
    return crc ^ 0xFFFFFFFFU;
}

size_t frame_encode(const struct frame *frame, uint8_t coded[LONGEST_FRAME]) {
    uint8_t *body = coded + 2; /* behind the delimiter and the first distance */
    uint8_t *end = write_u16(write_u8(write_u8(body, VERSION), frame->kind), frame->sequence);
    memcpy(end, frame->payload, frame->size);
    end += frame->size;
    end = write_u32(end, crc32(0, body, (size_t)(end - body)));

    uint8_t *distance = coded + 1; /* to the next zero */
    for (uint8_t *at = body; at < end; at++) {
        if (*at == 0U) {
            *distance = (uint8_t)(at - distance);
            distance = at;
        }
    }
    *distance = (uint8_t)(end - distance);
    coded[0] = 0;
    *end = 0;
    return (size_t)(end - coded) + 1U;
}

/* Undo COBS in place, which leaves a zero before the body: each distance to the next zero becomes
 * the zero that it stands for. Return whether the last one points to the end. */
static bool uncobs(uint8_t *coded, size_t size) {
    size_t at = 0;
    while (at < size) {
        const uint8_t distance = coded[at];
        coded[at] = 0;
        at += distance;
    }
    return at == size;
}

static bool frame_read(uint8_t *coded, size_t coded_size, struct frame *frame) {
    if (coded_size <= SHORTEST_BODY || coded_size > LONGEST_CODED || !uncobs(coded, coded_size)) {
        return false;
    }
    const uint8_t *body = coded + 1;
    const size_t content = coded_size - 1U - CRC_SIZE;
    if (read_u32(body + content) != crc32(0, body, content) || body[0] != VERSION) {
        return false;
    }
    frame->kind = body[1];
    frame->sequence = read_u16(body + 2);
    frame->size = content - 4U;
    memcpy(frame->payload, body + 4, frame->size);
    return true;
}

#define QUESTION_SIZE 5U
#define OTHER (QUESTION_SIZE + 1U)

static bool is_space(uint8_t byte) { return byte == 0x20U || (byte >= 0x09U && byte <= 0x0DU); }

/* Take a byte that is no delimiter; return whether it completes the question who is there. A frame
 * has its version, which is not text, as the second byte after a delimiter: what is only text is
 * no part of one. */
static bool is_asked(struct decoder *decoder, uint8_t byte) {
    static const uint8_t question[QUESTION_SIZE] = {'*', 'I', 'D', 'N', '?'};
    const bool is_text = is_space(byte) || (byte > 0x20U && byte < 0x7FU);
    decoder->is_binary = decoder->is_binary || !is_text;
    if (decoder->is_binary) {
        return false;
    }
    const size_t matched = decoder->matched;
    if (byte == 0x0AU) {
        decoder->matched = 0;
        return matched == QUESTION_SIZE;
    }
    if (matched != QUESTION_SIZE || !is_space(byte)) {
        const bool goes_on = matched < QUESTION_SIZE && byte == question[matched];
        decoder->matched = goes_on ? matched + 1U : OTHER;
    }
    return false;
}

enum received decoder_feed(struct decoder *decoder, uint8_t byte, struct frame *frame) {
    if (byte != 0U) {
        if (decoder->size < sizeof(decoder->piece)) {
            decoder->piece[decoder->size] = byte;
            decoder->size++;
        }
        return is_asked(decoder, byte) ? IDENTITY : NOTHING;
    }
    const bool is_frame = frame_read(decoder->piece, decoder->size, frame);
    *decoder = (struct decoder){.size = 0};
    return is_frame ? FRAME : NOTHING;
}

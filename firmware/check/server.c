/* A device that is asked through a pipe, at any device time: for tests that compare it.
 *
 * Reads records `operation u8 | now u64 | size u16 | bytes` and answers each but the first and the
 * last of these:
 *
 *     'B'  switch on: model 16, serial number 16, firmware 32, boot id u64, rate in mHz u32,
 *          entropy u8, emulated u8
 *     'R'  receive these bytes
 *     'H'  the line is lost
 *     'S'  switch and amplifier report: known u8, set u8
 *     'M'  what a monitor sees of every burst that ends from now on: as in MEASURED, without the
 *          token; nothing: none
 *     'F'  send what was answered
 *
 * An answer is `size u32 | bytes` of frames, the same of text, and 40 bytes of the last burst:
 * token u64, onset u64, duration u64, levels u32 u32, cut u8, CRC-32 of the steps of both channels
 * u32, and three bytes of nothing. */
#include "../core/endpoint.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LONGEST_INPUT 65535U

static struct endpoint endpoint;
static struct measured reading;
static bool has_reading;
static uint64_t settled_us; /* onset of the burst whose end was noticed last */
static uint8_t input[LONGEST_INPUT];
static uint8_t frames[8U * LONGEST_INPUT];
static uint8_t text[16U * LONGEST_INPUT];
static uint8_t steps[4U * CHANNELS * LONGEST_WAVEFORM];
static uint64_t crc_token;
static uint32_t crc;

static void switch_on(const uint8_t *at) {
    struct about about = {.boot_id = read_u64(at + 64),
                          .sample_rate_mhz = read_u32(at + 72),
                          .entropy = (enum entropy)at[76],
                          .emulated = at[77] != 0U};
    memcpy(about.model, at, NAME_SIZE);
    memcpy(about.serial_number, at + 16, NAME_SIZE);
    memcpy(about.firmware, at + 32, FIRMWARE_SIZE);
    /* what is behind the memory in use was never read: wiping all of it takes too long here */
    memset(&endpoint, 0, offsetof(struct endpoint, upload.came));
    memset(&endpoint.device, 0, offsetof(struct device, memory));
    has_reading = false;
    settled_us = UINT64_MAX;
    crc_token = 0;
    crc = 0;
    endpoint_init(&endpoint, &about);
}

static void settle(uint64_t now_us) {
    const struct burst *last = &endpoint.device.last;
    device_advance(&endpoint.device, now_us);
    if (endpoint.device.state != STATE_FIRED && !last->is_cut && last->start_us != settled_us) {
        settled_us = last->start_us;
        if (has_reading) {
            device_measure(&endpoint.device, &reading);
        }
    }
}

static void take_reading(const uint8_t *at, size_t size) {
    has_reading = size > 0U;
    if (has_reading) {
        reading = (struct measured){.tap = at[0],
                                    .unit = at[1],
                                    .left = read_u32(at + 2),
                                    .right = read_u32(at + 6),
                                    .onset_us = read_u32(at + 10),
                                    .uncertainty_us = read_u32(at + 14),
                                    .correlation_left = read_u16(at + 18),
                                    .correlation_right = read_u16(at + 20)};
    }
}

/* The steps are what the converter is given: those of a burst that plays, computed once. */
static void note_burst(void) {
    const struct burst *burst = &endpoint.device.last;
    if (endpoint.device.state != STATE_FIRED || burst->token == crc_token) {
        return;
    }
    const uint32_t samples = endpoint.device.slots[burst->slot].samples;
    uint8_t *at = steps;
    for (uint32_t channel = 0; channel < CHANNELS; channel++) {
        for (uint32_t i = 0; i < samples; i++) {
            at = write_u32(at, (uint32_t)device_step(&endpoint.device, burst, channel, i));
        }
    }
    crc = crc32(0, steps, (size_t)(at - steps));
    crc_token = burst->token;
}

static void put(const uint8_t *bytes, size_t size) {
    if (fwrite(bytes, 1, size, stdout) != size) {
        exit(1);
    }
}

static void answer(size_t frames_size, size_t text_size) {
    const struct burst *last = &endpoint.device.last;
    uint8_t told[40] = {0};
    (void)write_u32(told, (uint32_t)frames_size);
    put(told, 4);
    put(frames, frames_size);
    (void)write_u32(told, (uint32_t)text_size);
    put(told, 4);
    put(text, text_size);
    uint8_t *at = write_u64(write_u64(told, last->token), last->start_us);
    at = write_u64(at, last->duration_us);
    at = write_u32(write_u32(at, last->levels_mvpp[0]), last->levels_mvpp[1]);
    (void)write_u32(write_u8(at, last->is_cut ? 1U : 0U), crc);
    put(told, sizeof(told));
}

static void take(uint8_t operation, uint64_t now_us, size_t size) {
    size_t frames_size = 0;
    size_t text_size = 0;
    settle(now_us);
    if (operation == 'M') {
        take_reading(input, size);
    } else if (operation == 'S') {
        device_sense(&endpoint.device, input[0], input[1]);
    } else if (operation == 'H') {
        endpoint_hang_up(&endpoint);
    } else if (operation == 'R') {
        for (size_t i = 0; i < size; i++) {
            uint8_t told[LONGEST_ANSWER];
            const size_t told_size = endpoint_receive(&endpoint, input[i], told);
            if (input[i] == 0U) {
                memcpy(frames + frames_size, told, told_size);
                frames_size += told_size;
                note_burst();
            } else {
                memcpy(text + text_size, told, told_size);
                text_size += told_size;
            }
        }
    }
    answer(frames_size, text_size);
}

int main(void) {
    uint8_t head[11];
    while (fread(head, 1, sizeof(head), stdin) == sizeof(head)) {
        const size_t size = read_u16(head + 9);
        if (fread(input, 1, size, stdin) != size) {
            return 1;
        }
        if (head[0] == 'B') {
            switch_on(input);
        } else if (head[0] == 'F') {
            (void)fflush(stdout);
        } else {
            take(head[0], read_u64(head + 1), size);
        }
    }
    return 0;
}

#include "emulated.h"

#include <string.h>

#define DIGITS 20U
#define PEAK_DIGITS 18 /* so many that the nearest double is the one that is meant */

static void put(const char *text) { truth_put(text, strlen(text)); }

static void put_whole(uint64_t value, size_t least_digits) {
    char digits[DIGITS];
    size_t at = DIGITS;
    while (value > 0U || DIGITS - at < least_digits) {
        at--;
        digits[at] = (char)('0' + (char)(value % 10U));
        value /= 10U;
    }
    truth_put(&digits[at], DIGITS - at);
}

static void put_seconds(uint64_t time_us) {
    put_whole(time_us / 1000000U, 1);
    put(".");
    put_whole(time_us % 1000000U, 6);
}

static void begin(const char *event, uint64_t time_us) {
    put("{\"event\": \"");
    put(event);
    put("\", \"t_s\": ");
    put_seconds(time_us);
}

static void put_pair(const char *name, uint32_t left, uint32_t right) {
    put(name);
    put_whole(left, 1);
    put(", ");
    put_whole(right, 1);
    put("]");
}

static double volts_of(int32_t step) {
    return (double)step * (RAIL_MVPP / 2000.0) / (double)FULL_SCALE;
}

/* Base64 of bytes that come one by one. */
struct base64 {
    uint32_t bits;
    uint32_t n_bytes;
};

static void put_group(uint32_t bits, uint32_t n_bytes) {
    static const char alphabet[] =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    char group[4];
    for (uint32_t i = 0; i < 4U; i++) {
        group[i] = i <= n_bytes ? alphabet[(bits >> (18U - 6U * i)) & 0x3FU] : '=';
    }
    truth_put(group, sizeof(group));
}

static void base64_add(struct base64 *base64, uint8_t byte) {
    base64->bits |= (uint32_t)byte << (16U - 8U * base64->n_bytes);
    base64->n_bytes++;
    if (base64->n_bytes == 3U) {
        put_group(base64->bits, 3);
        *base64 = (struct base64){0};
    }
}

/* Put the volts of both channels as they lie in memory, 64 bit floats, little endian; return their
 * checksum. */
static uint32_t put_volts(const struct device *device, const struct burst *burst) {
    const uint32_t samples = device->slots[burst->slot].samples;
    struct base64 base64 = {0};
    uint32_t crc = 0;
    for (uint32_t channel = 0; channel < CHANNELS; channel++) {
        for (uint32_t i = 0; i < samples; i++) {
            const double volts = volts_of(device_step(device, burst, channel, i));
            uint8_t bytes[sizeof(volts)];
            memcpy(bytes, &volts, sizeof(volts));
            crc = crc32(crc, bytes, sizeof(bytes));
            for (size_t j = 0; j < sizeof(bytes); j++) {
                base64_add(&base64, bytes[j]);
            }
        }
    }
    if (base64.n_bytes > 0U) {
        put_group(base64.bits, base64.n_bytes);
    }
    return crc;
}

static uint32_t peak_step(const struct device *device, const struct burst *burst,
                          uint32_t channel) {
    const uint32_t samples = device->slots[burst->slot].samples;
    uint32_t peak = 0;
    for (uint32_t i = 0; i < samples; i++) {
        const int32_t step = device_step(device, burst, channel, i);
        const uint32_t magnitude = (uint32_t)(step < 0 ? -step : step);
        peak = magnitude > peak ? magnitude : peak;
    }
    return peak;
}

/* Put the volts of a step in decimals: no library that prints floats fits a small device. */
static void put_peak(uint32_t step) {
    const uint64_t whole = (uint64_t)FULL_SCALE * 2000U;
    uint64_t rest = (uint64_t)step * RAIL_MVPP;
    put_whole(rest / whole, 1);
    put(".");
    for (int i = 0; i < PEAK_DIGITS; i++) {
        rest = rest % whole * 10U;
        put_whole(rest / whole, 1);
    }
}

static void put_burst(const struct device *device, const struct burst *burst) {
    const uint32_t left = peak_step(device, burst, 0);
    const uint32_t right = peak_step(device, burst, 1);
    begin("burst", burst->start_us);
    put(", \"token\": ");
    put_whole(burst->token, 1);
    put_pair(", \"channels\": [", left > 0U ? 1U : 0U, right > 0U ? 1U : 0U);
    put_pair(", \"levels_mv\": [", burst->levels_mvpp[0], burst->levels_mvpp[1]);
    put(", \"peak_v\": [");
    put_peak(left);
    put(", ");
    put_peak(right);
    put("], \"volts\": \"");
    const uint32_t crc = put_volts(device, burst);
    put("\", \"crc\": ");
    put_whole(crc, 1);
    put("}\n");
}

/* A burst stands in the truth from its onset, before any answer tells of it; one that is cut gets a
 * line for that too. */
static void note_burst(struct emulated *emulated) {
    const struct device *device = &emulated->endpoint.device;
    const struct burst *burst = &device->last;
    if (burst->token != emulated->noted) {
        emulated->noted = burst->token;
        emulated->noted_cut = false;
        put_burst(device, burst);
    }
    if (burst->is_cut && !emulated->noted_cut) {
        emulated->noted_cut = true;
        begin("cut", burst->cut_us);
        put(", \"token\": ");
        put_whole(burst->token, 1);
        put("}\n");
    }
}

static void note_state(struct emulated *emulated, const char *cause) {
    const struct device *device = &emulated->endpoint.device;
    const bool is_on = device_is_on(device);
    if (is_on != emulated->was_on) {
        if (!is_on && strcmp(cause, "watchdog") == 0) {
            begin("watchdog", device->now_us);
            put("}\n");
        }
        begin(is_on ? "on" : "off", device->now_us);
        put(", \"cause\": \"");
        put(cause);
        put("\"}\n");
    }
    emulated->was_on = is_on;
}

static void sense(struct emulated *emulated) {
    if (emulated->senses) {
        device_sense(&emulated->endpoint.device, SWITCH_CLOSED | OVER_CURRENT,
                     emulated->loop.is_open ? 0U : SWITCH_CLOSED);
    }
}

void emulated_init(struct emulated *emulated, const struct about *about, uint64_t began_us) {
    endpoint_init(&emulated->endpoint, about);
    begin("boot", 0);
    put(", \"boot_id\": ");
    put_whole(about->boot_id, 1);
    put(", \"began_s\": ");
    put_seconds(began_us);
    put("}\n");
    sense(emulated);
}

static void move_switch(struct emulated *emulated, uint64_t now_us, bool is_open) {
    emulated_advance(emulated, now_us);
    emulated->loop.is_open = is_open;
    begin("switch", now_us);
    put(is_open ? ", \"closed\": false}\n" : ", \"closed\": true}\n");
    sense(emulated);
}

static bool is_word(const struct emulated *emulated, const char *word) {
    return emulated->word_size == strlen(word) &&
           memcmp(emulated->word, word, emulated->word_size) == 0;
}

void emulated_hear(struct emulated *emulated, uint64_t now_us, char byte) {
    static const char rule[] = "the switch is open or closed, got '";
    if (byte != '\n') {
        if (byte != '\r' && emulated->word_size < LONGEST_WORD) {
            emulated->word[emulated->word_size] = byte;
            emulated->word_size++;
        }
        return;
    }
    if (is_word(emulated, "open") || is_word(emulated, "closed")) {
        move_switch(emulated, now_us, is_word(emulated, "open"));
    } else {
        complain(rule, sizeof(rule) - 1U);
        complain(emulated->word, emulated->word_size);
        complain("'\n", 2);
    }
    emulated->word_size = 0;
}

void emulated_advance(struct emulated *emulated, uint64_t now_us) {
    struct device *device = &emulated->endpoint.device;
    device_advance(device, now_us);
    note_burst(emulated);
    note_state(emulated, "watchdog");
    if (device->last.token != emulated->loop.token && loop_record(&emulated->loop, device)) {
        device_begin_measuring(device);
    }
}

void emulated_measure(struct emulated *emulated) {
    struct device *device = &emulated->endpoint.device;
    struct monitor *monitor = &emulated->loop.monitor;
    struct measured measured;
    if (device->is_measuring && monitor_step(monitor)) {
        monitor_tell(monitor, device->sample_rate_mhz, &measured);
        device_measure(device, &measured);
    }
}

size_t emulated_receive(struct emulated *emulated, uint64_t now_us, uint8_t byte,
                        uint8_t answer[LONGEST_ANSWER]) {
    emulated_advance(emulated, now_us);
    const size_t size = endpoint_receive(&emulated->endpoint, byte, answer);
    note_burst(emulated);
    note_state(emulated, "host");
    return size;
}

void emulated_hang_up(struct emulated *emulated, uint64_t now_us, const char *cause) {
    emulated_advance(emulated, now_us);
    endpoint_hang_up(&emulated->endpoint);
    note_burst(emulated);
    note_state(emulated, cause);
}

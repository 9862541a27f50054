#include "upload.h"

#include "frames.h"

#include <string.h>

enum refusal upload_begin(struct upload *upload, const struct device *device, uint16_t number,
                          uint32_t slot, uint32_t samples) {
    if (samples == 0U) {
        return WAVEFORM_EMPTY;
    }
    if (samples > LONGEST_WAVEFORM) {
        return WAVEFORM_TOO_LONG;
    }
    const enum refusal refusal = device_check_room(device, slot, samples);
    if (refusal == DONE) {
        upload->is_under_way = true;
        upload->number = number;
        upload->slot = slot;
        upload->samples = samples;
        upload->size = 2U * CHANNELS * samples;
        upload->missing = (upload->size + LONGEST_DATA - 1U) / LONGEST_DATA;
        memset(upload->came, 0, sizeof(upload->came));
    }
    return refusal;
}

enum refusal upload_add(struct upload *upload, uint16_t number, uint32_t offset,
                        const uint8_t *octets, size_t size) {
    if (!upload->is_under_way || number != upload->number || offset % LONGEST_DATA != 0U ||
        offset >= upload->size) {
        return BAD_UPLOAD;
    }
    const uint32_t left = upload->size - offset;
    if (size != (left < LONGEST_DATA ? left : LONGEST_DATA)) {
        return BAD_UPLOAD;
    }
    const uint32_t piece = offset / LONGEST_DATA;
    const uint8_t bit = (uint8_t)(1U << (piece % 8U));
    if ((upload->came[piece / 8U] & bit) == 0U) {
        upload->came[piece / 8U] |= bit;
        upload->missing--;
    }
    memcpy(&upload->bytes[offset], octets, size);
    return DONE;
}

enum refusal upload_finish(struct upload *upload, struct device *device, uint32_t slot,
                           uint32_t crc) {
    const bool is_whole = upload->is_under_way && upload->slot == slot && upload->missing == 0U;
    upload->is_under_way = false;
    if (!is_whole || crc32(0, upload->bytes, upload->size) != crc) {
        return BAD_UPLOAD;
    }
    return device_load(device, slot, upload->samples, upload->bytes);
}

/* The device on QEMU's mps2-an385 (ARM AN385: a Cortex-M3 in an FPGA), without an actuator:
 * protocol on UART0, truth on UART1, what a test tells of amplifier and line on UART2. run.py
 * starts it.
 *
 * Registers: ARM DAI 0385, "Application Note AN385"; for the UART "Cortex-M System Design Kit" (ARM
 * DDI 0479), both as QEMU has them (hw/arm/mps2.c, hw/misc/mps2-fpgaio.c, hw/char/). */
#include "../../core/endpoint.h"
#include "../cortex.h"

#define UART0 0x40004000U
#define UART1 0x40005000U
#define UART2 0x40006000U
#define UART_DATA 0x00U
#define UART_STATE 0x04U
#define UART_CTRL 0x08U
#define UART_INTCLEAR 0x0CU
#define UART_BAUDDIV 0x10U
#define UART_TX_FULL 1U
#define UART_RX_FULL 2U
#define UART_TX_ENABLE 1U
#define UART_RX_ENABLE 2U
#define UART_RX_INTERRUPT 8U
#define UART0_RX_IRQ 0U
#define COUNTER REGISTER(0x40028018U)  /* FPGAIO: counts up, */
#define PRESCALE REGISTER(0x4002801CU) /* once in so many cycles, and one, of 25 MHz */
#define CLOCK_HZ 25000000U
#define PATIENCE_US 20000U /* for a host that does not read */
#define HEX_DIGITS_OF_STEP 4U
#define LINE_LOST 0x80U

/* Written by QEMU's loader before the first instruction. */
#define GIVEN_LOW REGISTER(0x20000000U)
#define GIVEN_HIGH REGISTER(0x20000004U)
#define GIVEN_RATE_MHZ REGISTER(0x20000008U)

static struct endpoint endpoint;

static uint64_t clock_us(void) { return cortex_time_us(COUNTER); }

static void uart0_rx_handler(void) {
    REGISTER(UART0 + UART_INTCLEAR) = 2U;
    while ((REGISTER(UART0 + UART_STATE) & UART_RX_FULL) != 0U) {
        cortex_keep((uint8_t)REGISTER(UART0 + UART_DATA));
    }
}

/* ARM AN385, 3.7. */
__attribute__((section(".interrupts"), used)) static void (*const interrupts[])(void) = {
    [UART0_RX_IRQ] = uart0_rx_handler,
};

/* Send, unless the line stands still: what a host does not read is lost, as on a wire. */
static void send(const uint8_t *bytes, size_t size) {
    const uint32_t began = COUNTER;
    for (size_t i = 0; i < size; i++) {
        while ((REGISTER(UART0 + UART_STATE) & UART_TX_FULL) != 0U) {
            if (COUNTER - began > PATIENCE_US) {
                return;
            }
        }
        REGISTER(UART0 + UART_DATA) = bytes[i];
    }
}

static void put(char character) {
    while ((REGISTER(UART1 + UART_STATE) & UART_TX_FULL) != 0U) {
    }
    REGISTER(UART1 + UART_DATA) = (uint8_t)character;
}

static void put_hex(uint64_t value, uint32_t n_digits) {
    for (uint32_t i = n_digits; i > 0U; i--) {
        put("0123456789abcdef"[(value >> (4U * (i - 1U))) & 15U]);
    }
}

/* A line of truth begins with what happened, the token and the time, in hexadecimal digits. */
static void put_event(char event, uint64_t token, uint64_t time_us) {
    put(event);
    put_hex(token, 16);
    put_hex(time_us, 16);
}

/* `b`, with each level in mVpp and the steps of the converter, channel by channel. */
static void put_burst(const struct device *device, const struct burst *burst) {
    put_event('b', burst->token, burst->start_us);
    for (uint32_t channel = 0; channel < CHANNELS; channel++) {
        put_hex(burst->levels_mvpp[channel], 8);
    }
    for (uint32_t channel = 0; channel < CHANNELS; channel++) {
        for (uint32_t i = 0; i < device->slots[burst->slot].samples; i++) {
            put_hex((uint32_t)device_step(device, burst, channel, i), HEX_DIGITS_OF_STEP);
        }
    }
    put('\n');
}

/* A burst stands in the truth from its onset, before any answer tells of it; one that is cut gets a
 * line `c` for that too. */
static void note_burst(void) {
    static uint64_t noted_us, cut_us;
    const struct burst *burst = &endpoint.device.last;
    if (burst->token != 0U && burst->start_us != noted_us) {
        noted_us = burst->start_us;
        put_burst(&endpoint.device, burst);
    }
    if (burst->is_cut && burst->cut_us != cut_us) {
        cut_us = burst->cut_us;
        put_event('c', burst->token, burst->cut_us);
        put('\n');
    }
}

/* A byte has the bits of `health` that are set, or is LINE_LOST. */
static void sense(void) {
    if ((REGISTER(UART2 + UART_STATE) & UART_RX_FULL) != 0U) {
        const uint8_t byte = (uint8_t)REGISTER(UART2 + UART_DATA);
        if (byte == LINE_LOST) {
            endpoint_hang_up(&endpoint);
        } else {
            device_sense(&endpoint.device, SWITCH_CLOSED | OVER_CURRENT, byte);
        }
    }
}

static void start(void) {
    PRESCALE = CLOCK_HZ / 1000000U - 1U;
    COUNTER = 0U;
    REGISTER(UART0 + UART_BAUDDIV) = 16U;
    REGISTER(UART1 + UART_BAUDDIV) = 16U;
    REGISTER(UART2 + UART_BAUDDIV) = 16U;
    REGISTER(UART0 + UART_CTRL) = UART_TX_ENABLE | UART_RX_ENABLE | UART_RX_INTERRUPT;
    REGISTER(UART1 + UART_CTRL) = UART_TX_ENABLE;
    REGISTER(UART2 + UART_CTRL) = UART_RX_ENABLE;
    cortex_start_tick(CLOCK_HZ);
    cortex_enable_interrupt(UART0_RX_IRQ);
}

int main(void) {
    const struct about about = {.model = "mps2-an385",
                                .serial_number = "1",
                                .firmware = "tactstrip firmware 2.0 qemu",
                                .boot_id = ((uint64_t)GIVEN_HIGH << 32) | GIVEN_LOW,
                                .sample_rate_mhz = GIVEN_RATE_MHZ,
                                .entropy = ENTROPY_GIVEN,
                                .emulated = true};
    start();
    endpoint_init(&endpoint, &about);
    for (;;) {
        uint8_t byte;
        cortex_sleep(); /* a loop that never sleeps starves the thread in which QEMU moves the bytes */
        device_advance(&endpoint.device, clock_us());
        sense();
        note_burst();
        if (cortex_take(&byte)) {
            uint8_t answer[LONGEST_ANSWER];
            const size_t size = endpoint_receive(&endpoint, byte, answer);
            note_burst();
            send(answer, size);
        }
    }
}

/* The device on QEMU's mps2-an385 (ARM AN385: a Cortex-M3 in an FPGA), without an actuator:
 * protocol on UART0, truth on UART1, what moves the amplifier's switch on UART2. run.py starts it.
 *
 * Registers: ARM DAI 0385, "Application Note AN385"; for the UART "Cortex-M System Design Kit" (ARM
 * DDI 0479), both as QEMU has them (hw/arm/mps2.c, hw/misc/mps2-fpgaio.c, hw/char/). */
#include "../../emulate/emulated.h"
#include "../startup.h"

#include <string.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
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
#define COUNTER REGISTER(0x40028018U)  /* FPGAIO: counts up, */
#define PRESCALE REGISTER(0x4002801CU) /* once in so many cycles, and one, of 25 MHz */
#define NVIC_ENABLE REGISTER(0xE000E100U)
#define UART0_RX_IRQ 0U
#define SYSTICK_CTRL REGISTER(0xE000E010U)
#define SYSTICK_RELOAD REGISTER(0xE000E014U)
#define CLOCK_HZ 25000000U
#define TICK_HZ 1000U
#define RING 4096U         /* of bytes received: far more than a window of DATA */
#define PATIENCE_US 20000U /* for a host that does not read */
#define TRUTH_PATIENCE_US 1000000U

/* Written by QEMU's loader before the first instruction, and again at each reset; zeros where it
 * was told nothing. A reset leaves RESETS alone: it tells one boot id from the next. */
#define GIVEN_LOW REGISTER(0x20000000U)
#define GIVEN_HIGH REGISTER(0x20000004U)
#define GIVEN_RATE_MHZ REGISTER(0x20000008U)
#define RESETS REGISTER(0x2000000CU)
#define GIVEN_GAIN_PPM REGISTER(0x20000010U)
#define GIVEN_DELAY_US REGISTER(0x20000014U)
#define GIVEN_NOISE_MV REGISTER(0x20000018U)
#define GIVEN_SENSES REGISTER(0x2000001CU)
#define SWITCH_OPEN REGISTER(0x20000020U) /* a reset does not move the amplifier's switch either */
#define TRUTH_IS_TORN REGISTER(0x20000024U) /* a reset came in the middle of a line */

static struct emulated emulated;
static volatile uint8_t ring[RING];
static volatile uint32_t received;
static uint32_t taken;

static uint64_t clock_us(void) {
    static uint64_t now_us;
    now_us += (uint32_t)(COUNTER - (uint32_t)now_us);
    return now_us;
}

void systick_handler(void) {} /* wakes the loop, which does what is due */

static void uart0_rx_handler(void) {
    REGISTER(UART0 + UART_INTCLEAR) = 2U;
    while ((REGISTER(UART0 + UART_STATE) & UART_RX_FULL) != 0U) {
        ring[received % RING] = (uint8_t)REGISTER(UART0 + UART_DATA);
        received++;
    }
}

/* Send, unless the line stands still: what a host does not read is lost, as on a wire. */
static void send(uint32_t uart, const uint8_t *bytes, size_t size) {
    const uint32_t began = COUNTER;
    for (size_t i = 0; i < size; i++) {
        while ((REGISTER(uart + UART_STATE) & UART_TX_FULL) != 0U) {
            if (COUNTER - began > PATIENCE_US) {
                return;
            }
        }
        REGISTER(uart + UART_DATA) = bytes[i];
    }
}

/* A truth with a hole is none: the device ends where it cannot be written. */
void truth_put(const char *text, size_t size) {
    for (size_t i = 0; i < size; i++) {
        const uint32_t began = COUNTER;
        while ((REGISTER(UART1 + UART_STATE) & UART_TX_FULL) != 0U) {
            if (COUNTER - began > TRUTH_PATIENCE_US) {
                halt();
            }
        }
        REGISTER(UART1 + UART_DATA) = (uint8_t)text[i];
        TRUTH_IS_TORN = text[i] != '\n' ? 1U : 0U;
    }
}

/* SYS_WRITEC of ARM's semihosting, which run.py has QEMU take; it writes to standard error. */
void complain(const char *text, size_t size) {
    for (size_t i = 0; i < size; i++) {
        __asm__ volatile("mov r0, #3\n\tmov r1, %0\n\tbkpt 0xAB"
                         :
                         : "r"(&text[i])
                         : "r0", "r1", "memory");
    }
}

static void hear_words(uint64_t now_us) {
    while ((REGISTER(UART2 + UART_STATE) & UART_RX_FULL) != 0U) {
        emulated_hear(&emulated, now_us, (char)REGISTER(UART2 + UART_DATA));
        SWITCH_OPEN = emulated.loop.is_open ? 1U : 0U;
    }
}

/* ARM AN385, 3.7. */
__attribute__((section(".interrupts"), used)) static void (*const interrupts[])(void) = {
    [UART0_RX_IRQ] = uart0_rx_handler,
};

static void start_clocks(void) {
    PRESCALE = CLOCK_HZ / 1000000U - 1U;
    COUNTER = 0U;
    SYSTICK_RELOAD = CLOCK_HZ / TICK_HZ - 1U;
    SYSTICK_CTRL = 7U; /* counts cycles, interrupts, on */
}

static void start_uarts(void) {
    REGISTER(UART0 + UART_BAUDDIV) = 16U;
    REGISTER(UART1 + UART_BAUDDIV) = 16U;
    REGISTER(UART2 + UART_BAUDDIV) = 16U;
    REGISTER(UART0 + UART_CTRL) = UART_TX_ENABLE | UART_RX_ENABLE | UART_RX_INTERRUPT;
    REGISTER(UART1 + UART_CTRL) = UART_TX_ENABLE;
    REGISTER(UART2 + UART_CTRL) = UART_RX_ENABLE;
    NVIC_ENABLE = 1U << UART0_RX_IRQ;
}

static uint64_t boot_id(void) {
    const uint64_t given = ((uint64_t)GIVEN_HIGH << 32) | GIVEN_LOW;
    RESETS++;
    return (given + RESETS * 0x9E3779B97F4A7C15U) >> 1; /* an odd number: no two are the same */
}

/* A loop that never sleeps would starve the thread in which QEMU moves the bytes. An interrupt that
 * comes between the look and the sleep still wakes it: that is what the mask is for. */
static void sleep_until_something_came(void) {
    __asm__ volatile("cpsid i" ::: "memory");
    if (received == taken && !emulated.endpoint.device.is_measuring) {
        __asm__ volatile("wfi");
    }
    __asm__ volatile("cpsie i" ::: "memory");
}

int main(void) {
    struct about about = {.model = "mps2-an385",
                          .serial_number = "1",
                          .firmware = "tactstrip firmware 2.0 qemu",
                          .boot_id = boot_id(),
                          .sample_rate_mhz = GIVEN_RATE_MHZ != 0U ? GIVEN_RATE_MHZ : 48000000U,
                          .entropy = GIVEN_HIGH != 0U ? ENTROPY_GIVEN : ENTROPY_NONE,
                          .emulated = true};
    start_clocks();
    start_uarts();
    emulated.loop.gain_ppm = GIVEN_GAIN_PPM;
    emulated.loop.delay_us = GIVEN_DELAY_US;
    emulated.loop.noise_mv = GIVEN_NOISE_MV;
    emulated.loop.is_open = SWITCH_OPEN != 0U;
    emulated.senses = GIVEN_SENSES != 0U;
    if (TRUTH_IS_TORN != 0U) {
        truth_put("\n", 1);
    }
    emulated_init(&emulated, &about, 0);
    for (;;) {
        sleep_until_something_came();
        hear_words(clock_us());
        emulated_advance(&emulated, clock_us());
        emulated_measure(&emulated);
        size_t size = 0; /* at most a frame: however much comes, what is measured goes on */
        for (uint32_t i = 0; i < LONGEST_FRAME && size == 0U && received != taken; i++) {
            uint8_t answer[LONGEST_ANSWER];
            size = emulated_receive(&emulated, clock_us(), ring[taken % RING], answer);
            taken++;
            send(UART0, answer, size);
        }
    }
}

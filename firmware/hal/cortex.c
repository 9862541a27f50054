#include "cortex.h"

#include <string.h>

#define SYSTICK_CTRL REGISTER(0xE000E010U)
#define SYSTICK_RELOAD REGISTER(0xE000E014U)
#define SYSTICK_ON 7U /* counts cycles, interrupts, on */
#define NVIC_ISER(word) REGISTER(0xE000E100U + 4U * (word))
#define TICK_HZ 1000U
#define RING 4096U /* of bytes received: far more than a window of DATA */

extern uint32_t stack_top, data_load, data_begin, data_end, bss_begin, bss_end;

static volatile uint8_t ring[RING];
static volatile uint32_t received;
static uint32_t taken;

_Noreturn void halt(void) {
    for (;;) {
    }
}

void reset_handler(void) {
    memcpy(&data_begin, &data_load, (size_t)((uintptr_t)&data_end - (uintptr_t)&data_begin));
    memset(&bss_begin, 0, (size_t)((uintptr_t)&bss_end - (uintptr_t)&bss_begin));
    (void)main();
    halt();
}

static void systick_handler(void) {} /* wakes the loop */

/* ARMv7-M Architecture Reference Manual, B1.5; link.ld puts a HAL's interrupts behind it. */
__attribute__((section(".vectors"), used)) static void (*const vectors[16])(void) = {
    (void (*)(void))(uintptr_t)&stack_top,
    reset_handler,
    [2] = halt,
    [3] = halt,
    [4] = halt,
    [5] = halt,
    [6] = halt,
    [15] = systick_handler,
};

void cortex_start_tick(uint32_t clock_hz) {
    SYSTICK_RELOAD = clock_hz / TICK_HZ - 1U;
    SYSTICK_CTRL = SYSTICK_ON;
}

void cortex_enable_interrupt(uint32_t number) {
    NVIC_ISER(number / 32U) = 1U << (number % 32U);
}

uint64_t cortex_time_us(uint32_t counter_us) {
    static uint64_t now_us;
    now_us += (uint32_t)(counter_us - (uint32_t)now_us);
    return now_us;
}

void cortex_keep(uint8_t byte) {
    ring[received % RING] = byte;
    received++;
}

bool cortex_take(uint8_t *byte) {
    if (received == taken) {
        return false;
    }
    *byte = ring[taken % RING];
    taken++;
    return true;
}

/* An interrupt that comes between the look and the sleep still wakes the loop: that is what the mask
 * is for. */
void cortex_sleep(void) {
    __asm__ volatile("cpsid i" ::: "memory");
    if (received == taken) {
        __asm__ volatile("wfi");
    }
    __asm__ volatile("cpsie i" ::: "memory");
}

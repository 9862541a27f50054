/* From reset to main, and the table of exceptions (ARMv7-M Architecture Reference Manual, B1.5):
 * behind it link.ld puts a HAL's table of interrupts. */
#include "startup.h"

#include <stdint.h>
#include <string.h>

extern uint32_t stack_top, data_load, data_begin, data_end, bss_begin, bss_end;

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

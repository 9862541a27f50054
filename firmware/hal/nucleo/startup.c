/* From reset to main, and the table of exceptions: RM0440, 14.3. A fault halts, and the watchdog
 * resets. */
#include <stdint.h>
#include <string.h>

extern uint32_t stack_top, data_load, data_begin, data_end, bss_begin, bss_end;

int main(void);
void reset_handler(void);
void systick_handler(void);
void dma1_channel1_handler(void);
void usart2_handler(void);
void exti15_10_handler(void);

static void halt(void) {
    for (;;) {
    }
}

void reset_handler(void) {
    memcpy(&data_begin, &data_load, (size_t)((uintptr_t)&data_end - (uintptr_t)&data_begin));
    memset(&bss_begin, 0, (size_t)((uintptr_t)&bss_end - (uintptr_t)&bss_begin));
    (void)main();
    halt();
}

__attribute__((section(".vectors"), used)) static void (*const vectors[])(void) = {
    (void (*)(void))(uintptr_t)&stack_top,
    reset_handler,
    [2] = halt,
    [3] = halt,
    [4] = halt,
    [5] = halt,
    [6] = halt,
    [15] = systick_handler,
    [16 + 11] = dma1_channel1_handler,
    [16 + 38] = usart2_handler,
    [16 + 40] = exti15_10_handler,
};

/* What is the same on every processor of the kind Cortex-M: its start, its tick, its interrupts, and
 * the bytes that one of them receives. */
#ifndef CORTEX_H
#define CORTEX_H

#include <stdbool.h>
#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))

/* The program; a HAL has it, and in a section `.interrupts` the table of its handlers. */
int main(void);

void reset_handler(void);

/* Stand still; where there is a watchdog, it resets. */
_Noreturn void halt(void);

/* Have an interrupt wake the loop once a millisecond, so that it does what is due. */
void cortex_start_tick(uint32_t clock_hz);

void cortex_enable_interrupt(uint32_t number);

/* Return the whole time of a counter of 32 bits; it is asked at least once in 71 minutes. */
uint64_t cortex_time_us(uint32_t counter_us);

/* Keep a byte that an interrupt received, and take the oldest that was kept, if there is one. */
void cortex_keep(uint8_t byte);
bool cortex_take(uint8_t *byte);

/* Sleep until the next interrupt, unless a byte is there. */
void cortex_sleep(void);

#endif

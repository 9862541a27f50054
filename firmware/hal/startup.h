/* What a processor of the kind Cortex-M does before main, and after a fault. */
#ifndef STARTUP_H
#define STARTUP_H

int main(void);

void reset_handler(void);

/* Comes once a millisecond; a HAL has it, and in a section `.interrupts` its own handlers. */
void systick_handler(void);

/* Stand still; where there is a watchdog, it resets. */
_Noreturn void halt(void);

#endif

/* The device on a Nucleo-G474RE. NOT TRIED ON HARDWARE: see firmware/README.md.
 *
 *     PA2, PA3  serial line, 115200 baud, behind the ST-Link's USB
 *     PA4, PA6  left and right, 12 bits, zero volts at half of the supply
 *     PA0, PA1  what comes of left and right, for MEASURED
 *     PA8       enable of the amplifier: high while the output is on
 *     PA9       safety switch: high is closed; pulled down, so that a broken wire is open
 *     PA10      over-current: high is a fault; pulled up, so that a broken wire is a fault
 */
#include "../../core/endpoint.h"
#include "../../monitor/monitor.h"
#include "../cortex.h"
#include "converter.h"
#include "registers.h"

#include <string.h>

#define CLOCK_HZ 144000000U
#define BAUD 115200U
#define RATE_MHZ 48000000U
#define PIN_ENABLE 8U
#define PIN_SWITCH 9U
#define PIN_OVER_CURRENT 10U
#define ANALOG 3U
#define ALTERNATE 2U
#define OUTPUT_PIN 1U
#define INPUT_PIN 0U
#define PULL_UP 1U
#define PULL_DOWN 2U
#define SERIAL 7U /* alternate function of PA2 and PA3 */
#define FEED 0xAAAAU
#define LAST_LAG_US 2000U /* more than LAGS samples take */
#define SETTLE_US 200000U /* in which the pins' pulls win at power on */

static struct endpoint endpoint;
static struct monitor monitor;
static bool is_recording; /* what comes behind the last sample of a burst */
static volatile bool over_current; /* since the loop last looked */

static void usart2_handler(void) {
    while ((USART2_ISR & USART_ISR_RXNE) != 0U) {
        cortex_keep((uint8_t)USART2_RDR);
    }
}

/* At once, whatever the loop is at. */
static void exti15_10_handler(void) {
    EXTI_PR1 = 1U << PIN_OVER_CURRENT;
    GPIOA_BSRR = 1U << (PIN_ENABLE + 16U);
    over_current = true;
}

/* RM0440, 14.3. */
__attribute__((section(".interrupts"), used)) static void (*const interrupts[])(void) = {
    [DMA1_CHANNEL1_IRQ] = dma1_channel1_handler,
    [USART2_IRQ] = usart2_handler,
    [EXTI15_10_IRQ] = exti15_10_handler,
};

/* 24 MHz from the board's crystal, by 6, times 72, by 2: 144 MHz, which 48 kHz divides. RM0440,
 * 6.1.5 and 7.2.7: a step at half speed on the way, and flash that waits for 4 cycles. */
static void start_clock(void) {
    RCC_CR |= RCC_CR_HSEON;
    while ((RCC_CR & RCC_CR_HSERDY) == 0U) {
    }
    RCC_PLLCFGR = 3U | (5U << 4) | (72U << 8) | (1U << 24);
    RCC_CR |= RCC_CR_PLLON;
    while ((RCC_CR & RCC_CR_PLLRDY) == 0U) {
    }
    FLASH_ACR = (FLASH_ACR & ~FLASH_ACR_LATENCY) | 4U;
    while ((FLASH_ACR & FLASH_ACR_LATENCY) != 4U) {
    }
    RCC_CFGR = RCC_CFGR_HPRE_2 | RCC_CFGR_SW_PLL;
    while ((RCC_CFGR & RCC_CFGR_SWS) != RCC_CFGR_SWS_PLL) {
    }
    for (volatile uint32_t i = 0; i < 100U; i++) {
    }
    RCC_CFGR &= ~RCC_CFGR_HPRE;
}

/* If the loop stands still for 100 ms the chip is reset: its pins let go, and the amplifier's
 * enable is pulled down. It cannot be switched off again. */
static void start_watchdog(void) {
    IWDG_KR = 0xCCCCU;
    IWDG_KR = 0x5555U;
    IWDG_PR = 1U;    /* 32 kHz by 8 */
    IWDG_RLR = 400U; /* 100 ms */
    while (IWDG_SR != 0U) {
    }
    IWDG_KR = FEED;
}

static void set_pin(uint32_t pin, uint32_t mode, uint32_t pull) {
    GPIOA_PUPDR = (GPIOA_PUPDR & ~(3U << (2U * pin))) | (pull << (2U * pin));
    GPIOA_MODER = (GPIOA_MODER & ~(3U << (2U * pin))) | (mode << (2U * pin));
}

static void start_pins(void) {
    RCC_AHB2ENR |= RCC_AHB2ENR_GPIOA;
    (void)RCC_AHB2ENR;
    GPIOA_BSRR = 1U << (PIN_ENABLE + 16U); /* low before it is an output */
    set_pin(PIN_ENABLE, OUTPUT_PIN, 0);
    set_pin(PIN_SWITCH, INPUT_PIN, PULL_DOWN);
    set_pin(PIN_OVER_CURRENT, INPUT_PIN, PULL_UP);
    set_pin(0, ANALOG, 0);
    set_pin(1, ANALOG, 0);
    set_pin(4, ANALOG, 0);
    set_pin(6, ANALOG, 0);
    EXTI_RTSR1 = 1U << PIN_OVER_CURRENT;
    EXTI_IMR1 |= 1U << PIN_OVER_CURRENT;
    cortex_enable_interrupt(EXTI15_10_IRQ);
    GPIOA_AFRL = (GPIOA_AFRL & ~0xFF00U) | (SERIAL << 8) | (SERIAL << 12);
    set_pin(2, ALTERNATE, 0);
    set_pin(3, ALTERNATE, PULL_UP);
}

static void start_timers(void) {
    RCC_APB1ENR1 |= RCC_APB1ENR1_TIM2 | RCC_APB1ENR1_USART2;
    (void)RCC_APB1ENR1;
    TIM2_PSC = CLOCK_HZ / 1000000U - 1U;
    TIM2_ARR = 0xFFFFFFFFU;
    TIM2_EGR = TIM_EGR_UG;
    TIM2_CR1 = TIM_CR1_CEN;
    cortex_start_tick(CLOCK_HZ);
}

static void start_line(void) {
    USART2_BRR = CLOCK_HZ / BAUD;
    USART2_CR3 = USART_CR3_OVRDIS;
    USART2_CR1 = USART_CR1_UE | USART_CR1_RE | USART_CR1_TE | USART_CR1_RXNEIE;
    cortex_enable_interrupt(USART2_IRQ);
}

/* RM0440, 26: a number that comes with a fault is no number. */
static uint32_t random_word(void) {
    while ((RNG_SR & RNG_SR_DRDY) == 0U || (RNG_SR & RNG_SR_FAULTS) != 0U) {
    }
    return RNG_DR;
}

static uint64_t random_boot_id(void) {
    RCC_CRRCR |= RCC_CRRCR_HSI48ON;
    while ((RCC_CRRCR & RCC_CRRCR_HSI48RDY) == 0U) {
    }
    RCC_AHB2ENR |= RCC_AHB2ENR_RNG;
    (void)RCC_AHB2ENR;
    RNG_CR = RNG_CR_RNGEN;
    (void)random_word(); /* the first is not used */
    const uint64_t high = random_word();
    return (high << 32 | random_word()) >> 1;
}

/* The 96 bits of the chip's number, folded to the 64 that a serial number has room for. */
static void write_serial_number(char text[NAME_SIZE]) {
    const uint32_t words[2] = {CHIP_NUMBER(0) ^ CHIP_NUMBER(2), CHIP_NUMBER(1)};
    for (uint32_t i = 0; i < NAME_SIZE; i++) {
        text[i] = "0123456789ABCDEF"[(words[i / 8U] >> (28U - 4U * (i % 8U))) & 15U];
    }
}

static uint64_t clock_us(void) { return cortex_time_us(TIM2_CNT); }

static void sense(void) {
    static uint8_t before = 0xFFU;
    const uint32_t pins = GPIOA_IDR;
    uint32_t set = (pins & (1U << PIN_SWITCH)) != 0U ? SWITCH_CLOSED : 0U;
    if (over_current || (pins & (1U << PIN_OVER_CURRENT)) != 0U) {
        over_current = false;
        set |= OVER_CURRENT;
    }
    if (set != before || (set & OVER_CURRENT) != 0U) { /* an OUTPUT does not end what goes on */
        before = (uint8_t)set;
        device_sense(&endpoint.device, SWITCH_CLOSED | OVER_CURRENT, (uint8_t)set);
    }
}

/* Begin to look at what was recorded: all of it, or what there is once the next burst is prepared. */
static void end_recording(void) {
    const struct slot *slot = &endpoint.device.slots[endpoint.device.last.slot];
    const uint32_t *words = NULL;
    const uint32_t count = converter_recorded(&words);
    const struct measured nothing = {.tap = TAP_NONE};
    converter_stop();
    is_recording = false;
    if (count >= slot->samples) {
        monitor_begin(&monitor, &endpoint.device.memory[slot->begin], slot->samples, words, count);
    } else {
        device_measure(&endpoint.device, &nothing);
    }
}

/* Go on with what was recorded of the last burst, a slice at a time. */
static void measure(uint64_t now_us) {
    struct device *device = &endpoint.device;
    const uint64_t end_us = device->last.start_us + device->last.duration_us;
    struct measured measured;
    if (is_recording) {
        if (converter_is_recorded() || now_us > end_us + LAST_LAG_US) {
            end_recording();
        }
    } else if (device->is_measuring && monitor_step(&monitor)) {
        monitor_tell(&monitor, RATE_MHZ, &measured);
        device_measure(device, &measured);
    }
}

/* Not over a fault that the loop has not seen yet. */
static void enable_amplifier(void) {
    __asm__ volatile("cpsid i" ::: "memory");
    if (!over_current) {
        GPIOA_BSRR = 1U << PIN_ENABLE;
    }
    __asm__ volatile("cpsie i" ::: "memory");
}

/* Let the outputs do what the device has decided. */
static void drive(void) {
    static uint64_t prepared;
    static bool plays;
    const struct device *device = &endpoint.device;
    const struct burst *last = &device->last;
    const bool is_on = device_is_on(device);
    if (!is_on) {
        GPIOA_BSRR = 1U << (PIN_ENABLE + 16U);
    }
    if (plays && device->state != STATE_FIRED) {
        plays = false;
        if (last->is_cut) {
            converter_stop();
        } else {
            device_begin_measuring(&endpoint.device);
            is_recording = true;
        }
    }
    if (!plays && device->state == STATE_FIRED) {
        converter_start();
        plays = true;
    }
    if (device->state != STATE_ARMED) {
        prepared = 0; /* a token that was forgotten may be armed with another slot */
    } else if (device->armed != prepared) {
        struct burst burst = {.token = device->armed, .slot = device->armed_slot};
        if (is_recording) {
            end_recording();
        }
        memcpy(burst.levels_mvpp, device->levels_mvpp, sizeof(burst.levels_mvpp));
        converter_prepare(device, &burst);
        prepared = device->armed;
    }
    if (is_on) {
        enable_amplifier();
    }
}

/* What is due, then what arrived: so that the answer tells of nothing that has not happened. */
static void turn(uint64_t now_us) {
    device_advance(&endpoint.device, now_us);
    sense();
    if (endpoint.device.state == STATE_FIRED && converter_underran()) {
        device_stop(&endpoint.device);
    }
    drive();
    IWDG_KR = FEED;
}

/* An answer takes up to 8 ms: what is due meanwhile is not late for it. */
static void send(const uint8_t *bytes, size_t size) {
    for (size_t i = 0; i < size; i++) {
        while ((USART2_ISR & USART_ISR_TXE) == 0U) {
            turn(clock_us());
        }
        USART2_TDR = bytes[i];
    }
}

/* What arrived, at most a frame: however much comes, what is measured goes on. */
static void take_frame(void) {
    size_t size = 0;
    uint8_t byte;
    for (uint32_t i = 0; i < LONGEST_FRAME && size == 0U && cortex_take(&byte); i++) {
        uint8_t answer[LONGEST_ANSWER];
        turn(clock_us());
        size = endpoint_receive(&endpoint, byte, answer);
        drive();
        send(answer, size);
    }
}

int main(void) {
    struct about about = {.model = "nucleo-g474re",
                          .firmware = "tactstrip firmware 2.0 nucleo",
                          .sample_rate_mhz = RATE_MHZ,
                          .entropy = ENTROPY_HARDWARE};
    start_pins();
    start_watchdog();
    start_clock();
    start_timers();
    write_serial_number(about.serial_number);
    about.boot_id = random_boot_id();
    converter_init();
    endpoint_init(&endpoint, &about);
    while (clock_us() < SETTLE_US) {
        IWDG_KR = FEED;
    }
    over_current = false; /* the edge of the pull; a fault that stays is seen as a level */
    start_line();
    for (;;) {
        if (!endpoint.device.is_measuring) {
            cortex_sleep();
        }
        turn(clock_us());
        measure(clock_us());
        take_frame();
    }
}

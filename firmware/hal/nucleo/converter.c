#include "converter.h"

#include "../../monitor/monitor.h"
#include "registers.h"

#include <stddef.h>

#define CLOCK_HZ 144000000U
#define RATE_HZ 48000U
#define MIDDLE 2048U /* the code of zero volts: what is behind the pin makes it so */
#define REACH 1792U  /* codes to both sides of it: 0.206 to 3.094 V of 3.3 V */
#define HALF 128U    /* samples that are filled at a time: 2.7 ms ahead */
#define TO_LEFT 0U   /* DMA channels */
#define TO_RIGHT 1U
#define FROM_INPUTS 2U
#define LATER 0x80U /* priority: to fill a half takes longer than a byte of the line */
#define REGULATOR_US 20U

#define AT_REST (DAC_CR_TSEL1_TIM6 | DAC_CR_EN1) /* a code is put out at once */

/* With its buffer a pin goes from 0.2 V to 0.2 V below the supply (related parts; to be checked in
 * DS12288, DAC characteristics). A burst of the ceiling must not be clipped there; the board's
 * RAIL_MVPP leaves that room. */
static_assert(BITS == 12U, "the converters have 12 bits");
static_assert((uint64_t)FULL_SCALE * CEILING_MVPP <= (uint64_t)REACH * RAIL_MVPP,
              "the buffer of the pins reaches 7/8 of the full scale: RAIL_MVPP is too small");

static uint16_t buffers[CHANNELS][2U * HALF];
static uint32_t recording[LONGEST_WAVEFORM + LAGS];
static const struct device *source;
static struct burst playing;
static uint32_t n_samples; /* of the burst: its slot may be filled anew once it is over */
static uint32_t filled;    /* samples of the burst that are in the buffers, or were */

static uint32_t wait_us(uint32_t time_us) {
    const uint32_t began = TIM2_CNT;
    while (TIM2_CNT - began < time_us) {
    }
    return TIM2_CNT;
}

/* Fill a half of both buffers with what comes next; behind the last sample is nothing. */
static void fill(uint32_t half) {
    for (uint32_t i = 0; i < HALF; i++) {
        for (uint32_t channel = 0; channel < CHANNELS; channel++) {
            int32_t step = 0;
            if (filled < n_samples) {
                step = device_step(source, &playing, channel, filled);
            }
            buffers[channel][half * HALF + i] = (uint16_t)((int32_t)MIDDLE + step);
        }
        filled++;
    }
}

/* DMA has played a half and goes on with the other. Both channels are asked by the same timer: the
 * right one is behind by less than a sample. */
void dma1_channel1_handler(void) {
    const uint32_t events = DMA1_ISR;
    DMA1_IFCR = DMA_ALL(TO_LEFT);
    if ((events & DMA_HALF(TO_LEFT)) != 0U) {
        fill(0);
    }
    if ((events & DMA_WHOLE(TO_LEFT)) != 0U) {
        fill(1);
    }
}

/* RM0440, 22.4.7: the trigger is chosen while the converter is off. */
static void start_dac(uint32_t dac) {
    DAC_MCR(dac) = DAC_MCR_HFSEL_80_MHZ; /* to the pin, with its buffer */
    DAC_CR(dac) = DAC_CR_TSEL1_TIM6;
    DAC_CR(dac) = AT_REST;
    DAC_DHR12R1(dac) = MIDDLE;
}

/* RM0440, 21.4.6 to 21.4.9: regulator, calibration, ready. */
static void start_adc(uint32_t adc, uint32_t input) {
    ADC_CR(adc) = 0; /* out of deep power-down */
    ADC_CR(adc) = ADC_CR_ADVREGEN;
    (void)wait_us(REGULATOR_US);
    ADC_CR(adc) = ADC_CR_ADVREGEN | ADC_CR_ADCAL;
    while ((ADC_CR(adc) & ADC_CR_ADCAL) != 0U) {
    }
    (void)wait_us(1);
    ADC_ISR(adc) = ADC_ISR_ADRDY;
    ADC_CR(adc) = ADC_CR_ADVREGEN | ADC_CR_ADEN;
    while ((ADC_ISR(adc) & ADC_ISR_ADRDY) == 0U) {
    }
    ADC_SMPR1(adc) = 4U << (3U * input); /* 47.5 cycles of 36 MHz */
    ADC_SQR1(adc) = input << 6;
}

void converter_init(void) {
    RCC_AHB1ENR |= RCC_AHB1ENR_DMA1 | RCC_AHB1ENR_DMAMUX1;
    RCC_AHB2ENR |= RCC_AHB2ENR_ADC12 | RCC_AHB2ENR_DAC1 | RCC_AHB2ENR_DAC2;
    RCC_APB1ENR1 |= RCC_APB1ENR1_TIM6;
    (void)RCC_APB1ENR1; /* a clock needs two cycles to arrive */
    (void)wait_us(1);
    TIM6_ARR = CLOCK_HZ / RATE_HZ - 1U;
    TIM6_CR2 = TIM_CR2_MMS_UPDATE;
    start_dac(DAC1);
    start_dac(DAC2);
    ADC12_CCR = ADC_CCR_CKMODE_BUS_4 | ADC_CCR_DUAL_REGULAR;
    start_adc(ADC1, 1);
    start_adc(ADC2, 2);
    ADC_CFGR(ADC1) = ADC_CFGR_EXTSEL_TIM6 | ADC_CFGR_EXTEN_RISING | ADC_CFGR_OVRMOD;
    ADC_CFGR(ADC2) = ADC_CFGR_OVRMOD;
    DMAMUX_CCR(TO_LEFT) = REQUEST_DAC1_CH1;
    DMAMUX_CCR(TO_RIGHT) = REQUEST_DAC2_CH1;
    DMAMUX_CCR(FROM_INPUTS) = REQUEST_ADC1;
    NVIC_IPR(DMA1_CHANNEL1_IRQ) = LATER;
    cortex_enable_interrupt(DMA1_CHANNEL1_IRQ);
}

static void feed(uint32_t channel, uint32_t dac, uint16_t *buffer, uint32_t interrupts) {
    DMA_CCR(channel) = 0;
    DMA_CNDTR(channel) = 2U * HALF;
    DMA_CPAR(channel) = dac + 0x08U;
    DMA_CMAR(channel) = (uint32_t)(uintptr_t)buffer;
    DMA_CCR(channel) = DMA_CCR_EN | DMA_CCR_DIR_OUT | DMA_CCR_CIRC | DMA_CCR_MINC |
                       DMA_CCR_PSIZE_32 | DMA_CCR_MSIZE_16 | interrupts;
    DAC_SR(dac) = DAC_SR_DMAUDR1;
    DAC_CR(dac) = AT_REST | DAC_CR_TEN1 | DAC_CR_DMAEN1;
}

/* The timer goes on behind the last word of a recording, so that samples overrun: nothing is
 * asked for until that is cleared. Requests end with the DMA's last word and begin anew here. */
static void record(void) {
    ADC12_CCR = ADC_CCR_CKMODE_BUS_4 | ADC_CCR_DUAL_REGULAR;
    DMA_CCR(FROM_INPUTS) = 0;
    (void)ADC12_CDR; /* what is left from the last time asks for nothing */
    ADC_ISR(ADC1) = ADC_ISR_OVR;
    ADC_ISR(ADC2) = ADC_ISR_OVR;
    DMA_CNDTR(FROM_INPUTS) = n_samples + LAGS;
    DMA_CPAR(FROM_INPUTS) = ADC12_CDR_ADDRESS;
    DMA_CMAR(FROM_INPUTS) = (uint32_t)(uintptr_t)recording;
    DMA_CCR(FROM_INPUTS) = DMA_CCR_EN | DMA_CCR_MINC | DMA_CCR_PSIZE_32 | DMA_CCR_MSIZE_32;
    ADC12_CCR = ADC_CCR_CKMODE_BUS_4 | ADC_CCR_DUAL_REGULAR | ADC_CCR_MDMA_12_BIT;
    ADC_CR(ADC1) = ADC_CR_ADVREGEN | ADC_CR_ADEN | ADC_CR_ADSTART;
}

void converter_prepare(const struct device *device, const struct burst *burst) {
    converter_stop();
    source = device;
    playing = *burst;
    n_samples = device->slots[burst->slot].samples;
    filled = 0;
    fill(0);
    fill(1);
}

/* The timer's first event comes at once: it puts out the zero that waits, asks for the first
 * sample, and has the inputs read. The first sample comes with the second event, 21 us later. */
void converter_start(void) {
    DMA1_IFCR = DMA_ALL(TO_LEFT) | DMA_ALL(TO_RIGHT) | DMA_ALL(FROM_INPUTS);
    feed(TO_LEFT, DAC1, buffers[0], DMA_CCR_HTIE | DMA_CCR_TCIE);
    feed(TO_RIGHT, DAC2, buffers[1], 0);
    record();
    TIM6_CNT = CLOCK_HZ / RATE_HZ - 2U;
    TIM6_CR1 = TIM_CR1_CEN;
}

bool converter_underran(void) {
    return ((DAC_SR(DAC1) | DAC_SR(DAC2)) & DAC_SR_DMAUDR1) != 0U;
}

void converter_stop(void) {
    TIM6_CR1 = 0;
    DMA_CCR(TO_LEFT) = 0;
    DMA_CCR(TO_RIGHT) = 0;
    DAC_CR(DAC1) = AT_REST;
    DAC_CR(DAC2) = AT_REST;
    DAC_DHR12R1(DAC1) = MIDDLE;
    DAC_DHR12R1(DAC2) = MIDDLE;
    DAC_SR(DAC1) = DAC_SR_DMAUDR1;
    DAC_SR(DAC2) = DAC_SR_DMAUDR1;
    DMA1_IFCR = DMA_ALL(TO_LEFT);
    if ((ADC_CR(ADC1) & ADC_CR_ADSTART) != 0U) {
        ADC_CR(ADC1) = ADC_CR_ADVREGEN | ADC_CR_ADEN | ADC_CR_ADSTP;
        while ((ADC_CR(ADC1) & ADC_CR_ADSTP) != 0U) {
        }
    }
    DMA_CCR(FROM_INPUTS) = 0;
}

bool converter_is_recorded(void) { return DMA_CNDTR(FROM_INPUTS) == 0U; }

uint32_t converter_recorded(const uint32_t **words) {
    *words = recording;
    return n_samples + LAGS - DMA_CNDTR(FROM_INPUTS);
}

/* Registers of the STM32G474RE, as far as they are used.
 *
 * Written from ST's reference manual RM0440 (memory map: 2.2; each block has its chapter); addresses,
 * offsets and bits agree with ST's device header stm32g474xx.h. Pins: data sheet DS12288.
 */
#ifndef REGISTERS_H
#define REGISTERS_H

#include "../cortex.h"

#include <stdint.h>

/* Reset and clock control */
#define RCC_CR REGISTER(0x40021000U)
#define RCC_CR_HSEON (1U << 16)
#define RCC_CR_HSERDY (1U << 17)
#define RCC_CR_PLLON (1U << 24)
#define RCC_CR_PLLRDY (1U << 25)
#define RCC_CFGR REGISTER(0x40021008U)
#define RCC_CFGR_SW_PLL 3U
#define RCC_CFGR_SWS (3U << 2)
#define RCC_CFGR_SWS_PLL (3U << 2)
#define RCC_CFGR_HPRE_2 (8U << 4)
#define RCC_CFGR_HPRE (15U << 4)
#define RCC_PLLCFGR REGISTER(0x4002100CU)
#define RCC_AHB1ENR REGISTER(0x40021048U)
#define RCC_AHB1ENR_DMA1 (1U << 0)
#define RCC_AHB1ENR_DMAMUX1 (1U << 2)
#define RCC_AHB2ENR REGISTER(0x4002104CU)
#define RCC_AHB2ENR_GPIOA (1U << 0)
#define RCC_AHB2ENR_ADC12 (1U << 13)
#define RCC_AHB2ENR_DAC1 (1U << 16)
#define RCC_AHB2ENR_DAC2 (1U << 17)
#define RCC_AHB2ENR_RNG (1U << 26)
#define RCC_APB1ENR1 REGISTER(0x40021058U)
#define RCC_APB1ENR1_TIM2 (1U << 0)
#define RCC_APB1ENR1_TIM6 (1U << 4)
#define RCC_APB1ENR1_USART2 (1U << 17)
#define RCC_CRRCR REGISTER(0x40021098U)
#define RCC_CRRCR_HSI48ON (1U << 0)
#define RCC_CRRCR_HSI48RDY (1U << 1)
#define FLASH_ACR REGISTER(0x40022000U)
#define FLASH_ACR_LATENCY 15U

/* Pins: two bits of mode each, 0 input, 1 output, 2 alternate, 3 analog */
#define GPIOA_MODER REGISTER(0x48000000U)
#define GPIOA_PUPDR REGISTER(0x4800000CU)
#define GPIOA_IDR REGISTER(0x48000010U)
#define GPIOA_BSRR REGISTER(0x48000018U)
#define GPIOA_AFRL REGISTER(0x48000020U)

/* Serial line, behind the ST-Link */
#define USART2_CR1 REGISTER(0x40004400U)
#define USART_CR1_UE (1U << 0)
#define USART_CR1_RE (1U << 2)
#define USART_CR1_TE (1U << 3)
#define USART_CR1_RXNEIE (1U << 5)
#define USART2_CR3 REGISTER(0x40004408U)
#define USART_CR3_OVRDIS (1U << 12)
#define USART2_BRR REGISTER(0x4000440CU)
#define USART2_ISR REGISTER(0x4000441CU)
#define USART_ISR_RXNE (1U << 5)
#define USART_ISR_TXE (1U << 7)
#define USART2_RDR REGISTER(0x40004424U)
#define USART2_TDR REGISTER(0x40004428U)
#define USART2_IRQ 38U

/* Edges of pins, of port A unless told otherwise */
#define EXTI_IMR1 REGISTER(0x40010400U)
#define EXTI_RTSR1 REGISTER(0x40010408U)
#define EXTI_PR1 REGISTER(0x40010414U)
#define EXTI15_10_IRQ 40U

/* Timers: TIM2 counts microseconds, TIM6 samples */
#define TIM2_CR1 REGISTER(0x40000000U)
#define TIM2_EGR REGISTER(0x40000014U)
#define TIM2_CNT REGISTER(0x40000024U)
#define TIM2_PSC REGISTER(0x40000028U)
#define TIM2_ARR REGISTER(0x4000002CU)
#define TIM6_CR1 REGISTER(0x40001000U)
#define TIM6_CR2 REGISTER(0x40001004U)
#define TIM6_CNT REGISTER(0x40001024U)
#define TIM6_ARR REGISTER(0x4000102CU)
#define TIM_CR1_CEN 1U
#define TIM_CR2_MMS_UPDATE (2U << 4)
#define TIM_EGR_UG 1U

/* Independent watchdog */
#define IWDG_KR REGISTER(0x40003000U)
#define IWDG_PR REGISTER(0x40003004U)
#define IWDG_RLR REGISTER(0x40003008U)
#define IWDG_SR REGISTER(0x4000300CU)

/* DMA1, its channels from 0 on, and what each is asked by */
#define DMA1_ISR REGISTER(0x40020000U)
#define DMA1_IFCR REGISTER(0x40020004U)
#define DMA_HALF(channel) (4U << (4U * (channel)))
#define DMA_WHOLE(channel) (2U << (4U * (channel)))
#define DMA_ALL(channel) (15U << (4U * (channel)))
#define DMA_CCR(channel) REGISTER(0x40020008U + 20U * (channel))
#define DMA_CNDTR(channel) REGISTER(0x4002000CU + 20U * (channel))
#define DMA_CPAR(channel) REGISTER(0x40020010U + 20U * (channel))
#define DMA_CMAR(channel) REGISTER(0x40020014U + 20U * (channel))
#define DMA_CCR_EN (1U << 0)
#define DMA_CCR_TCIE (1U << 1)
#define DMA_CCR_HTIE (1U << 2)
#define DMA_CCR_DIR_OUT (1U << 4)
#define DMA_CCR_CIRC (1U << 5)
#define DMA_CCR_MINC (1U << 7)
#define DMA_CCR_PSIZE_32 (2U << 8)
#define DMA_CCR_MSIZE_16 (1U << 10)
#define DMA_CCR_MSIZE_32 (2U << 10)
#define DMAMUX_CCR(channel) REGISTER(0x40020800U + 4U * (channel))
#define REQUEST_ADC1 5U
#define REQUEST_DAC1_CH1 6U
#define REQUEST_DAC2_CH1 41U
#define DMA1_CHANNEL1_IRQ 11U

/* Converters to volts: offsets are the same in both */
#define DAC1 0x50000800U
#define DAC2 0x50000C00U
#define DAC_CR(dac) REGISTER(dac)
#define DAC_DHR12R1(dac) REGISTER((dac) + 0x08U)
#define DAC_SR(dac) REGISTER((dac) + 0x34U)
#define DAC_MCR(dac) REGISTER((dac) + 0x3CU)
#define DAC_CR_EN1 (1U << 0)
#define DAC_CR_TEN1 (1U << 1)
#define DAC_CR_TSEL1_TIM6 (7U << 2)
#define DAC_CR_DMAEN1 (1U << 12)
#define DAC_SR_DMAUDR1 (1U << 13)
#define DAC_MCR_HFSEL_80_MHZ (1U << 14) /* the bus runs at 80 MHz or more */

/* Converters from volts: two that convert at once */
#define ADC1 0x50000000U
#define ADC2 0x50000100U
#define ADC_ISR(adc) REGISTER(adc)
#define ADC_CR(adc) REGISTER((adc) + 0x08U)
#define ADC_CFGR(adc) REGISTER((adc) + 0x0CU)
#define ADC_SMPR1(adc) REGISTER((adc) + 0x14U)
#define ADC_SQR1(adc) REGISTER((adc) + 0x30U)
#define ADC_ISR_ADRDY (1U << 0)
#define ADC_ISR_OVR (1U << 4)
#define ADC_CR_ADEN (1U << 0)
#define ADC_CR_ADSTART (1U << 2)
#define ADC_CR_ADSTP (1U << 4)
#define ADC_CR_ADVREGEN (1U << 28)
#define ADC_CR_ADCAL (1U << 31)
#define ADC_CFGR_EXTSEL_TIM6 (13U << 5)
#define ADC_CFGR_EXTEN_RISING (1U << 10)
#define ADC_CFGR_OVRMOD (1U << 12)
#define ADC12_CCR REGISTER(0x50000308U)
#define ADC12_CDR_ADDRESS 0x5000030CU
#define ADC12_CDR REGISTER(ADC12_CDR_ADDRESS)
#define ADC_CCR_DUAL_REGULAR 6U
#define ADC_CCR_MDMA_12_BIT (2U << 14)
#define ADC_CCR_CKMODE_BUS_4 (3U << 16)

/* Random numbers, and the number of this very chip */
#define RNG_CR REGISTER(0x50060800U)
#define RNG_SR REGISTER(0x50060804U)
#define RNG_DR REGISTER(0x50060808U)
#define RNG_CR_RNGEN (1U << 2)
#define RNG_SR_DRDY (1U << 0)
#define RNG_SR_FAULTS (6U)
#define CHIP_NUMBER(word) REGISTER(0x1FFF7590U + 4U * (word))

/* The core: ARMv7-M Architecture Reference Manual, B3 */
#define NVIC_IPR(interrupt) (*(volatile uint8_t *)(0xE000E400U + (interrupt)))

#endif

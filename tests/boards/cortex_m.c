/* Starts a program on a bare Cortex-M of qemu, and ends it with a status by semihosting. */
#include <stdint.h>

int main(void);
void start(void);

#ifndef STACK
#define STACK 0x20400000u /* where it begins, at the end of the memory */
#endif

extern const uintptr_t vectors[16];
__attribute__((section(".vectors"))) const uintptr_t vectors[16] = { STACK, (uintptr_t)start };

void start(void)
{
#if defined(__ARM_FP)
    *(volatile uint32_t *)0xe000ed88u |= 0xfu << 20; /* the floating-point unit is on */
    __asm__ volatile("dsb\n isb");
#endif
    volatile uint32_t block[2] = { 0x20026u, (uint32_t)main() }; /* ADP_Stopped_ApplicationExit */
    register uint32_t operation __asm__("r0") = 0x20u;           /* SYS_EXIT_EXTENDED */
    register volatile uint32_t *argument __asm__("r1") = block;
    __asm__ volatile("bkpt 0xab" : : "r"(operation), "r"(argument) : "memory");
    for (;;) { }
}

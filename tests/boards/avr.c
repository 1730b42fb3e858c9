/* Tells main's status by the serial line of an AVR, and ends the simulation. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

int tests(void);

static void put(char c)
{
    while (!(UCSR0A & _BV(UDRE0))) { }
    UDR0 = c;
}

int main(void)
{
    const int status = tests();
    UCSR0B = _BV(TXEN0);
    put('<');
    for (int digit = 1000; digit != 0; digit /= 10) { put((char)('0' + status / digit % 10)); }
    put('>');
    put('\n');
    cli();
    sleep_enable();
    sleep_cpu();
    return 0;
}

// What a sketch may use of Arduino's core.
#include <stdbool.h>
#include <stdint.h>

#define HEX 16

struct Printer {
    void begin(unsigned long) {}
    void print(char) {}
    void print(const char *) {}
    void print(double, int = 2) {}
    void println(int, int = 10) {}
    void println(unsigned long, int = 10) {}
};

static Printer Serial;
unsigned long micros();

"""Words that no name of a spec may be: keywords, macros of C's headers, macros of Arduino and avr-libc.

The emitted code is compiled as C and as C++, and included by sketches; a macro of the same name would
rewrite it.
"""

from __future__ import annotations

import keyword
import re

from kfgen.spec.tree import FUNCTIONS


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


C_KEYWORDS = _words(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int
    long register restrict return short signed sizeof static struct switch typedef union unsigned void
    volatile while asm fortran typeof typeof_unqual alignas alignof bool constexpr false nullptr
    static_assert thread_local true
    """
)
CPP_KEYWORDS = _words(
    """
    alignas alignof and and_eq asm atomic_cancel atomic_commit atomic_noexcept auto bitand bitor bool
    break case catch char char8_t char16_t char32_t class compl concept const consteval constexpr
    constinit const_cast continue co_await co_return co_yield decltype default delete do double
    dynamic_cast else enum explicit export extern false float for friend goto if inline int long mutable
    namespace new noexcept not not_eq nullptr operator or or_eq private protected public reflexpr register
    reinterpret_cast requires return short signed sizeof static static_assert static_cast struct switch
    synchronized template this thread_local throw true try typedef typeid typename union unsigned using
    virtual void volatile wchar_t while xor xor_eq
    """
)
PYTHON_KEYWORDS = frozenset(keyword.kwlist)

C_MACROS = _words(
    """
    NULL EOF BUFSIZ RAND_MAX EXIT_SUCCESS EXIT_FAILURE errno assert NDEBUG offsetof va_start va_arg va_end
    va_copy stdin stdout stderr setjmp CLOCKS_PER_SEC EDOM ERANGE EILSEQ TIME_UTC INFINITY NAN HUGE_VAL
    HUGE_VALF HUGE_VALL MATH_ERRNO MATH_ERREXCEPT math_errhandling FP_NAN FP_INFINITE FP_ZERO FP_NORMAL
    FP_SUBNORMAL FP_FAST_FMA FP_FAST_FMAF FP_FAST_FMAL FP_ILOGB0 FP_ILOGBNAN fpclassify isfinite isinf
    isnan isnormal signbit isgreater isgreaterequal isless islessequal islessgreater isunordered M_E
    M_LOG2E M_LOG10E M_LN2 M_LN10 M_PI M_PI_2 M_PI_4 M_1_PI M_2_PI M_2_SQRTPI M_SQRT2 M_SQRT1_2 MAXFLOAT
    DOMAIN SING OVERFLOW UNDERFLOW PLOSS TLOSS HUGE X_TLOSS FLT_RADIX FLT_ROUNDS FLT_EVAL_METHOD
    DECIMAL_DIG CHAR_BIT SCHAR_MIN SCHAR_MAX UCHAR_MAX CHAR_MIN CHAR_MAX SHRT_MIN SHRT_MAX USHRT_MAX
    INT_MIN INT_MAX UINT_MAX LONG_MIN LONG_MAX ULONG_MAX LLONG_MIN LLONG_MAX ULLONG_MAX MB_LEN_MAX
    SIZE_MAX PTRDIFF_MIN PTRDIFF_MAX WCHAR_MIN WCHAR_MAX WINT_MIN WINT_MAX SIG_ATOMIC_MIN SIG_ATOMIC_MAX
    INTPTR_MIN INTPTR_MAX UINTPTR_MAX INTMAX_MIN INTMAX_MAX UINTMAX_MAX INTMAX_C UINTMAX_C I complex
    imaginary noreturn linux unix i386 near far
    """
)
_C_MACRO_PATTERN = re.compile(
    r"(?:U?INT(?:_LEAST|_FAST)?(?:8|16|32|64)_(?:MIN|MAX|C|WIDTH)|(?:FLT|DBL|LDBL)_\w+|(?:PRI|SCN)[diouxX]\w*)\Z"
)

ARDUINO_MACROS = _words(
    """
    HIGH LOW INPUT OUTPUT INPUT_PULLUP INPUT_PULLDOWN OUTPUT_OPENDRAIN OPEN_DRAIN ANALOG PULLUP PULLDOWN
    PI HALF_PI TWO_PI DEG_TO_RAD RAD_TO_DEG EULER SERIAL DISPLAY LSBFIRST MSBFIRST CHANGE FALLING RISING
    DEC HEX OCT BIN ONLOW ONHIGH DEFAULT EXTERNAL INTERNAL INTERNAL1V1 INTERNAL1V2 INTERNAL2V5 INTERNAL2V56
    INTERNAL2V56_EXTCAP VDD AREF abs min max round sq constrain radians degrees map bit byte word boolean
    bitRead bitSet bitClear bitToggle bitWrite lowByte highByte interrupts noInterrupts
    clockCyclesPerMicrosecond clockCyclesToMicroseconds microsecondsToClockCycles isr yield
    digitalPinToPort digitalPinToBitMask digitalPinToTimer analogInPinToBit portOutputRegister
    portInputRegister portModeRegister digitalPinToInterrupt digitalPinHasPWM digitalPinToPCICR
    digitalPinToPCICRbit digitalPinToPCMSK digitalPinToPCMSKbit analogInputToDigitalPin NOT_A_PIN
    NOT_A_PORT NOT_AN_INTERRUPT NOT_ON_TIMER NUM_DIGITAL_PINS NUM_ANALOG_INPUTS LED_BUILTIN LED_BUILTIN_RX
    LED_BUILTIN_TX SS MOSI MISO SCK SDA SCL TX RX F F_CPU ARDUINO AVR PROGMEM PSTR PGM_P RAMEND RAMSTART
    FLASHEND E2END XRAMEND SPM_PAGESIZE cli sei cbi sbi ISR SIGNAL EMPTY_INTERRUPT ISR_BLOCK ISR_NOBLOCK
    ISR_NAKED ISR_ALIASOF BADISR_vect ATOMIC_BLOCK NONATOMIC_BLOCK ATOMIC_RESTORESTATE ATOMIC_FORCEON
    NONATOMIC_RESTORESTATE NONATOMIC_FORCEOFF bit_is_set bit_is_clear loop_until_bit_is_set
    loop_until_bit_is_clear pgm_read_byte pgm_read_word pgm_read_dword pgm_read_float pgm_read_ptr SREG SP
    SPL SPH EIND RAMPX RAMPY RAMPZ RAMPD ADC ADCH ADCL ADCW ADCSRA ADCSRB ADMUX MCUSR MCUCR SMCR WDTCSR
    OSCCAL CLKPR PRR EEAR EEDR EECR SPCR SPSR SPDR ACSR TWBR TWSR TWAR TWDR TWCR TWAMR EICRA EIMSK EIFR
    PCICR PCIFR GTCCR ASSR XL XH YL YH ZL ZH
    """
)
_ARDUINO_PATTERN = re.compile(
    r"(?:B[01]{1,8}|A\d{1,2}|D(?:\d|1[0-5])|DAC\d|PIN_\w+|(?:PORT|DDR|PIN)[A-L][0-7]?|P[A-L][0-7]?|DD[A-L][0-7]|TIMER\d\w*"
    r"|(?:TCCR|TCNT|OCR|TIMSK|TIFR|ICR)\d\w*|(?:UDR|UCSR|UBRR)\w*|PCMSK\d|GPIOR\d|PCINT\d+)\Z"
)

EXPRESSION_NAMES = frozenset({"pi", "e", "t", "dt"})

C_HEADERS = _words(
    """
    assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign stdarg
    stdatomic stdbit stdbool stdckdint stddef stdint stdio stdlib stdnoreturn string tgmath threads time
    uchar wchar wctype
    """
)


def reserved(name: str, in_expressions: bool = True) -> str | None:
    """Why a word may not be a name of a spec, or None. in_expressions: whether formulas can say it."""
    if in_expressions and name in FUNCTIONS:
        return "is a function of the language"
    if in_expressions and name in EXPRESSION_NAMES:
        return "has a meaning in expressions"
    if name in C_KEYWORDS:
        return "is a keyword of C"
    if name in CPP_KEYWORDS:
        return "is a keyword of C++"
    if name in PYTHON_KEYWORDS:
        return "is a keyword of Python"
    if name in C_MACROS or _C_MACRO_PATTERN.match(name):
        return "is a macro of C's headers"
    if name in ARDUINO_MACROS or _ARDUINO_PATTERN.match(name):
        return "is a macro of Arduino"
    return None

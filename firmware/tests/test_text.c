/* CRC, numbers and words at their edges. */
#include <string.h>

#include "crc16.h"
#include "fake_port.h"
#include "span.h"
#include "text.h"

static struct span span(const char *text)
{
    return (struct span){text, strlen(text)};
}

static void test_crc_has_the_check_value_of_ccitt_false(void)
{
    CHECK(crc16("123456789", 9) == 0x29B1);
    CHECK(crc16("", 0) == 0xFFFF);
}

static void test_numbers_fit_32_bits_or_are_refused(void)
{
    uint32_t number = 7;
    CHECK(span_number(span("0"), &number) && number == 0);
    CHECK(span_number(span("4294967295"), &number) && number == UINT32_MAX);
    const char *wrong[] = {"", "4294967296", "9999999999", "99999999999", "-1", "+1", "1.0", "0x1", " 1", "1a"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        CHECK(!span_number(span(wrong[i]), &number));
}

static void test_written_numbers_can_be_read(void)
{
    const uint32_t numbers[] = {0, 9, 10, 6400, 1000000, UINT32_MAX};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        struct text text = {.length = 0};
        uint32_t back = 1;
        text_number(&text, numbers[i]);
        CHECK(span_number((struct span){text.bytes, text.length}, &back) && back == numbers[i]);
    }
}

static void test_hex_is_four_upper_case_digits(void)
{
    uint16_t number = 0;
    struct text text = {.length = 0};
    text_hex16(&text, 0x0AF9);
    CHECK(text.length == 4 && !memcmp(text.bytes, "0AF9", 4));
    CHECK(span_hex16(span("0AF9"), &number) && number == 0x0AF9);
    CHECK(!span_hex16(span("0af9"), &number) && !span_hex16(span("0AF"), &number) &&
          !span_hex16(span("0AF91"), &number));
}

static void test_words_are_equal_only_as_a_whole(void)
{
    CHECK(span_equals(span("ARM"), "ARM") && !span_equals(span("ARMS"), "ARM") && !span_equals(span("AR"), "ARM"));
    struct span rest = span("12 ARM  5");
    CHECK(span_equals(span_next_word(&rest), "12") && span_equals(span_next_word(&rest), "ARM"));
    CHECK(span_next_word(&rest).length == 0 && span_equals(span_next_word(&rest), "5"));
    CHECK(rest.length == 0 && span_next_word(&rest).length == 0);
}

static void test_an_overlong_text_is_cut(void)
{
    struct text text = {.length = 0};
    for (int i = 0; i < TEXT_SIZE; i++)
        text_word(&text, "ab");
    CHECK(text.length == TEXT_SIZE);
}

int main(void)
{
    test_crc_has_the_check_value_of_ccitt_false();
    test_numbers_fit_32_bits_or_are_refused();
    test_written_numbers_can_be_read();
    test_hex_is_four_upper_case_digits();
    test_words_are_equal_only_as_a_whole();
    test_an_overlong_text_is_cut();
    return 0;
}

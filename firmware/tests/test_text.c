/* CRC, numbers and words at their edges. */
#include <string.h>

#include "crc16.h"
#include "fake_port.h"
#include "reply.h"
#include "span.h"

static struct generator generator;

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

/* Of what was sent, the CRC left out. */
static struct span sent(struct reply *reply)
{
    reply_end(reply);
    return span_next_word(&(struct span){fake.reply, strlen(fake.reply) - 6});
}

static void test_written_numbers_can_be_read(void)
{
    const uint32_t numbers[] = {0, 9, 10, 6400, 1000000, UINT32_MAX};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        struct reply reply = reply_begin(&generator);
        uint32_t back = 1;
        reply_number(&reply, numbers[i]);
        CHECK(span_number(sent(&reply), &back) && back == numbers[i]);
    }
}

static void test_a_line_ends_in_its_crc(void)
{
    struct reply reply = reply_begin(&generator);
    reply_word(&reply, "123456789");
    reply_end(&reply);
    CHECK(!strcmp(fake.reply, "123456789*29B1\n"));
    reply = reply_begin(&generator);
    reply_fields(&reply, "", NULL);
    reply_fields(&reply, "one two", (const uint32_t[]){1, 2});
    CHECK(sent(&reply).length == 0 && !strncmp(fake.reply, " one=1 two=2*", 13));
}

static void test_hex_is_four_upper_case_digits(void)
{
    uint16_t number = 0;
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

int main(void)
{
    fake_reset();
    test_crc_has_the_check_value_of_ccitt_false();
    test_numbers_fit_32_bits_or_are_refused();
    test_written_numbers_can_be_read();
    test_a_line_ends_in_its_crc();
    test_hex_is_four_upper_case_digits();
    test_words_are_equal_only_as_a_whole();
    return 0;
}

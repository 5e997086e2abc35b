#include "protocol.h"

#include "commands.h"
#include "crc16.h"
#include "generator.h"
#include "port.h"
#include "safety.h"
#include "span.h"

enum { CRC_LENGTH = 5 }; /* *1A2B */

void protocol_boot(struct protocol *protocol, uint32_t boot, enum cause cause)
{
    *protocol = (struct protocol){.boot = boot, .cause = cause};
    generator_boot(&protocol->generator, cause);
}

/* Cut the CRC off the line; false where it is missing or wrong. */
static bool take_crc(struct span *line, uint16_t *crc)
{
    if (line->length < CRC_LENGTH)
        return false;
    const size_t body = line->length - CRC_LENGTH;
    const struct span digits = {line->start + body + 1, CRC_LENGTH - 1};
    if (line->start[body] != '*' || !span_hex16(digits, crc) || *crc != crc16(line->start, body))
        return false;
    line->length = body;
    return true;
}

static void write_error(struct reply *reply, uint32_t boot, enum error error)
{
    reply_word(reply, " ");
    reply_number(reply, boot);
    reply_word(reply, " ERR ");
    reply_number(reply, (uint32_t)error);
}

static void write_ok(struct reply *reply, uint32_t boot)
{
    reply_word(reply, " ");
    reply_number(reply, boot);
    reply_word(reply, " OK");
}

static void write_unreadable(const struct protocol *protocol, struct reply *reply, enum error error)
{
    reply_word(reply, "<?");
    write_error(reply, protocol->boot, error);
}

static void write_kept(const struct protocol *protocol, struct reply *reply)
{
    const struct answer *kept = &protocol->kept;
    if (kept->error) {
        write_error(reply, protocol->boot, kept->error);
    } else {
        write_ok(reply, protocol->boot);
        reply_fields(reply, kept->names, kept->values);
    }
}

static bool is_newest(const struct protocol *protocol, uint32_t sequence)
{
    return protocol->answered && protocol->sequence == sequence;
}

static void identify(const struct protocol *protocol, struct reply *reply)
{
    write_ok(reply, protocol->boot);
    commands_identify(reply, protocol->cause, protocol->sequence);
}

/* Only a command that is carried out is a sign of life: what is repeated, refused or no command may come from a line that
 * runs by itself. */
static void run_command(struct protocol *protocol, struct span word, struct span rest)
{
    commands_run(&protocol->generator, word, rest, &protocol->kept);
    if (!protocol->kept.error)
        safety_heard(&protocol->generator);
}

/* A line with a good CRC and a sequence number. It is carried out before any of its reply is sent, which takes time. */
static void answer(struct protocol *protocol, uint32_t sequence, uint16_t crc, struct span rest, struct reply *reply)
{
    const struct span word = span_next_word(&rest);
    const bool asks_id = span_equals(word, "ID") && !rest.length;
    if (!asks_id && !is_newest(protocol, sequence)) {
        run_command(protocol, word, rest);
        protocol->answered = true;
        protocol->sequence = sequence;
        protocol->crc = crc;
    }
    reply_word(reply, "<");
    reply_number(reply, sequence);
    if (asks_id)
        identify(protocol, reply); /* opens a session: always answered afresh, and leaves the kept reply alone */
    else if (protocol->crc == crc)
        write_kept(protocol, reply);
    else
        write_error(reply, protocol->boot, ERROR_SEQUENCE);
}

static bool take_sequence(struct span *rest, uint32_t *sequence)
{
    return span_number(span_next_word(rest), sequence) && *sequence <= MAX_SEQUENCE;
}

/* Of a line without mark, which is that of an older host, or of none. */
static void answer_older(const struct protocol *protocol, struct span rest, struct reply *reply)
{
    uint32_t sequence = 0;
    if (take_sequence(&rest, &sequence) && span_equals(rest, "ID")) {
        reply_number(reply, sequence);
        identify(protocol, reply);
    } else {
        write_unreadable(protocol, reply, ERROR_SYNTAX);
    }
}

static bool take_mark(struct span *rest)
{
    const bool marked = rest->length && rest->start[0] == REQUEST_MARK;
    rest->start += marked;
    rest->length -= marked;
    return marked;
}

static void write_reply(struct protocol *protocol, struct reply *reply)
{
    struct span rest = {protocol->line, protocol->length};
    uint16_t crc = 0;
    uint32_t sequence = 0;
    if (protocol->overflow || !take_crc(&rest, &crc)) {
        protocol->generator.counters.crc_errors++;
        write_unreadable(protocol, reply, protocol->overflow ? ERROR_LINE_TOO_LONG : ERROR_CRC);
        return;
    }
    generator_poll(&protocol->generator); /* a host that comes back too late still finds the fault */
    if (!take_mark(&rest)) {
        answer_older(protocol, rest, reply);
    } else if (!take_sequence(&rest, &sequence)) {
        write_unreadable(protocol, reply, ERROR_SYNTAX);
    } else {
        answer(protocol, sequence, crc, rest, reply);
    }
}

static void answer_line(struct protocol *protocol)
{
    struct reply reply = reply_begin(&protocol->generator);
    write_reply(protocol, &reply);
    reply_end(&reply);
}

static void end_line(struct protocol *protocol)
{
    if (protocol->line[0] != REPLY_MARK)
        answer_line(protocol);
    protocol->length = 0;
    protocol->overflow = false;
}

void protocol_receive(struct protocol *protocol, char byte)
{
    if (byte == ABORT_BYTE) {
        safety_off(&protocol->generator);
    } else if (byte == HANG_UP_BYTE) {
        safety_hung_up(&protocol->generator);
    } else if (byte == '\n') {
        if (protocol->length || protocol->overflow)
            end_line(protocol); /* an empty line is no line: a host may send it to end a torn one */
    } else if (protocol->length == MAX_LINE) {
        protocol->overflow = true;
    } else if (byte != '\r') {
        protocol->line[protocol->length++] = byte;
    }
}

void protocol_poll(struct protocol *protocol)
{
    generator_poll(&protocol->generator);
}

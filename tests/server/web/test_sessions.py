"""Sessions of browsers, and how many wrong tokens an address may offer."""

from server.lab.desk.visitor import Role
from server.web.sessions import KEPT_S, Sessions
from server.web.tries import MOST, WITHIN_S, Tries


def test_a_session_is_a_random_word_that_ends_twelve_hours_after_the_last_request() -> None:
    now_s = [0.0]
    sessions = Sessions(lambda: now_s[0])
    one, two = (sessions.begin(Role.VIEWER, "10.0.0.1") for _ in range(2))
    assert one.id != two.id
    assert len(one.id) > 40
    for _ in range(3):
        now_s[0] += KEPT_S
        assert sessions.find(one.id) == one
    assert sessions.find(two.id) is None
    sessions.end(one.id)
    assert sessions.find(one.id) is None


def test_an_operator_may_say_his_name() -> None:
    sessions = Sessions()
    nameless = sessions.begin(Role.OPERATOR, "127.0.0.1")
    assert nameless.name == "operator 1 at 127.0.0.1"
    sessions.rename(nameless.id, " ann ")
    named = sessions.find(nameless.id)
    assert named is not None
    assert (named.name, named.role) == ("ann", Role.OPERATOR)
    assert sessions.rename("nobody", "ann") is None


def test_the_number_of_sessions_is_bounded() -> None:
    now_s = [0.0]
    sessions = Sessions(lambda: now_s[0])
    first = sessions.begin(Role.OPERATOR, "a")
    for _ in range(1000):
        now_s[0] += 1
        sessions.begin(Role.OPERATOR, "a")
    assert sessions.find(first.id) is None


def test_twenty_wrong_tokens_in_a_minute_are_the_last_ones_of_an_address_for_a_while() -> None:
    now_s = [0.0]
    tries = Tries(lambda: now_s[0])
    for _ in range(MOST):
        assert tries.wait_s("evil") == 0
        tries.count("evil")
        now_s[0] += 1
    assert tries.wait_s("evil") == WITHIN_S - MOST
    assert tries.wait_s("ann") == 0
    now_s[0] += WITHIN_S - MOST
    assert tries.wait_s("evil") == 0


def test_the_many_addresses_of_an_ipv6_home_try_as_one() -> None:
    tries = Tries(lambda: 0.0)
    for number in range(MOST):
        tries.count(f"2001:db8:1:2::{number:x}")
    assert tries.wait_s("2001:db8:1:2:ffff::1") == WITHIN_S
    assert tries.wait_s("2001:db8:1:3::1") == 0
    for number in range(MOST):
        tries.count(f"fe80::{number:x}%eth0")
    assert tries.wait_s("fe80::ffff%eth0") == WITHIN_S
    for number in range(MOST):
        tries.count(f"::ffff:10.0.0.{number}")
    assert tries.wait_s("::ffff:10.0.0.1") == 0


def test_a_name_is_one_line_and_reads_forwards() -> None:
    sessions = Sessions()
    told = sessions.begin(Role.OPERATOR, "127.0.0.1", "ann\n\x1b[31m\u202enna")
    assert told.name == "ann[31mnna"
    renamed = sessions.rename(told.id, "bob\r\n")
    assert renamed is not None
    assert renamed.name == "bob"

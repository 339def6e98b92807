"""Boxes: served in order, bounded, and one sender's burst costs nobody else anything."""

import threading

from frictus_service.daemon.inboxes import SENDERS, CommandQueue


def test_the_urgent_are_served_first_and_what_is_lost_is_counted() -> None:
    mailbox: CommandQueue[int] = CommandQueue({"stop": 2, "newest": 1})
    assert [mailbox.post("newest", item) for item in range(3)] == [[], [0], [1]]
    mailbox.post("stop", 9)
    assert mailbox.take() == ("stop", 9)
    assert mailbox.take() == ("newest", 2)
    assert mailbox.lost == {"stop": 0, "newest": 2}


def test_a_burst_pushes_out_and_holds_up_nobody_elses() -> None:
    mailbox: CommandQueue[str] = CommandQueue({"call": 2})
    mailbox.post("call", "ann 0", "ann")
    for item in range(100):
        mailbox.post("call", f"ben {item}", "ben")
    mailbox.post("call", "ann 1", "ann")
    taken = [mailbox.take() for _ in range(4)]
    assert taken == [("call", item) for item in ("ann 0", "ben 98", "ann 1", "ben 99")]
    assert mailbox.lost == {"call": 98}


def test_a_box_is_bounded_whoever_sends() -> None:
    mailbox: CommandQueue[int] = CommandQueue({"call": 2})
    lost = [mailbox.post("call", item, str(item)) for item in range(2 * SENDERS)]
    assert lost == [[]] * SENDERS + [[item] for item in range(SENDERS)]
    assert mailbox.lost == {"call": SENDERS}


def test_who_waits_is_woken_when_it_closes() -> None:
    mailbox: CommandQueue[int] = CommandQueue({"call": 1})
    taken: list[object] = [0]
    waiting = threading.Thread(target=lambda: taken.append(mailbox.take()))
    waiting.start()
    mailbox.close()
    waiting.join(5.0)
    assert taken == [0, None]

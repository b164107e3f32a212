import threading

from pretouch.page.action_queue import ActionQueue


def test_of_one_kind_only_the_newest_waits_and_in_its_own_place() -> None:
    commands, done = ActionQueue(), []
    for i in range(1000):
        commands.put(lambda i=i: done.append(i), "hand")
        if i == 500:
            commands.put(lambda: done.append(-1))
    assert len(commands) == 2
    for action in commands.take():
        action()
    assert done == [-1, 999]
    assert commands.take() == []


def test_what_has_to_settle_waits_until_nothing_newer_came_for_so_long() -> None:
    commands, done = ActionQueue(), []

    def tick(now: float) -> None:
        for asked in commands.take(now):
            asked()

    for i, now in enumerate((0.0, 0.7, 1.4)):
        commands.put(lambda i=i: done.append(i), "number", settle=0.8)
        tick(now)
    tick(2.1)
    assert done == []
    assert commands.is_waiting("number")
    tick(2.2)
    assert done == [2]
    assert not commands.is_waiting("number")


def test_something_else_asked_for_ends_the_wait_of_what_came_before_and_quiet_things_do_not() -> None:
    commands = ActionQueue()
    commands.put(lambda: "typed", "number", settle=0.8)
    commands.put(lambda: "hand", "hand", quiet=True)
    assert [asked.action() for asked in commands.take(0.0)] == ["hand"]
    commands.put(lambda: "button")
    commands.put(lambda: "typed later", "other number", settle=0.8)
    assert [asked.action() for asked in commands.take(0.1)] == ["typed", "button"]
    assert commands.is_waiting("other number")
    assert [asked.action() for asked in commands.take()] == ["typed later"]


def test_nothing_is_lost_between_threads() -> None:
    commands, done, end = ActionQueue(), [], threading.Event()

    def ask(start: int) -> None:
        for i in range(start, start + 500):
            commands.put(lambda i=i: done.append(i))

    def obey() -> None:
        while not (end.is_set() and not len(commands)):
            for action in commands.take():
                action()

    people = [threading.Thread(target=ask, args=(1000 * k,)) for k in range(4)]
    loop = threading.Thread(target=obey)
    for thread in (*people, loop):
        thread.start()
    for thread in people:
        thread.join()
    end.set()
    loop.join()
    assert sorted(done) == sorted(1000 * k + i for k in range(4) for i in range(500))
    assert all([i for i in done if i // 1000 == k] == list(range(1000 * k, 1000 * k + 500)) for k in range(4))

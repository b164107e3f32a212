import threading

from pretouch.viewer.commands import Commands


def test_actions_come_in_the_order_in_which_they_were_asked_for() -> None:
    commands, done = Commands(), []
    for i in range(5):
        commands.put(lambda i=i: done.append(i))
    for action in commands.take():
        action()
    assert done == [0, 1, 2, 3, 4]
    assert commands.take() == []


def test_of_one_kind_only_the_newest_waits_and_in_its_own_place() -> None:
    commands, done = Commands(), []
    for i in range(1000):
        commands.put(lambda i=i: done.append(i), "hand")
        if i == 500:
            commands.put(lambda: done.append(-1))
    assert len(commands) == 2
    for action in commands.take():
        action()
    assert done == [-1, 999]


def test_nothing_is_lost_between_threads() -> None:
    commands, done, end = Commands(), [], threading.Event()

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

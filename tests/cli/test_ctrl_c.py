"""Ctrl-C waits for the end of a moment that must not be cut in two, and is known where a library lost it."""

import contextlib
import os
import signal
import threading

import pytest

from gramoscope.cli import main as module
from gramoscope.errors import GramoscopeError
from gramoscope.interruption import ctrl_c_noted, ctrl_c_waits


def _press_ctrl_c():
    os.kill(os.getpid(), signal.SIGINT)


def test_ctrl_c_comes_at_the_end_of_the_moment_and_works_afterwards():
    done = []

    def moment():
        with ctrl_c_waits():
            _press_ctrl_c()
            done.append("all of it")

    with pytest.raises(KeyboardInterrupt):
        moment()
    assert done == ["all of it"]
    with pytest.raises(KeyboardInterrupt):
        _press_ctrl_c()


def test_an_error_in_the_moment_is_the_one_to_tell_about():
    def moment():
        with ctrl_c_waits():
            _press_ctrl_c()
            raise ValueError("mine")

    with pytest.raises(ValueError, match="mine"):
        moment()
    with pytest.raises(KeyboardInterrupt):
        _press_ctrl_c()


def test_on_another_thread_nothing_changes():
    handlers = []

    def look():
        with ctrl_c_waits():
            handlers.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert handlers == [signal.default_int_handler]


@pytest.mark.parametrize(
    "told", [TypeError("expected a path"), OSError("no such file"), GramoscopeError("a", "b", "c")]
)
def test_ctrl_c_that_a_library_lost_is_no_error(monkeypatch, capsys, told):
    """NumPy, asked to write an array: stopped while it looks at the file, it says that the file is of the wrong type."""

    def writing(*_, **__):
        with contextlib.suppress(KeyboardInterrupt):
            _press_ctrl_c()
        raise told

    monkeypatch.setattr(module, "app", writing)
    assert module.main(["info"]) == 130
    assert capsys.readouterr().err == "\nStopped. No half-written file was left.\n"


def test_what_was_done_all_the_same_is_done(monkeypatch):
    def nearly_done(*_, **__):
        with contextlib.suppress(KeyboardInterrupt):
            _press_ctrl_c()
        return 1

    monkeypatch.setattr(module, "app", nearly_done)
    assert module.main(["info"]) == 1


def test_ctrl_c_is_noted_from_the_beginning_of_the_block_to_its_end():
    before = signal.getsignal(signal.SIGINT)
    with ctrl_c_noted() as came:
        assert not came()
        with pytest.raises(KeyboardInterrupt):
            _press_ctrl_c()
        assert came()
    assert signal.getsignal(signal.SIGINT) is before
    with ctrl_c_noted() as came:
        assert not came()


def test_who_does_not_listen_goes_on_not_listening():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with ctrl_c_noted() as came:
            _press_ctrl_c()
            assert not came()
    finally:
        signal.signal(signal.SIGINT, before)


def test_another_error_is_not_taken_for_ctrl_c(monkeypatch):
    def failing(*_, **__):
        raise RuntimeError("a defect")

    monkeypatch.setattr(module, "app", failing)
    with pytest.raises(RuntimeError, match="a defect"):
        module.main(["info"])

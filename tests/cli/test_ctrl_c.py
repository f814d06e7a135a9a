"""Ctrl-C waits for the end of a moment that must not be cut in two, and is known behind the errors that hide it."""

import os
import signal
import threading

import pytest

from gramoscope.cli import main as module
from gramoscope.interruption import ctrl_c_waits, was_ctrl_c


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


def _hidden(by):
    try:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise by from (error if by.args == ("cause",) else None)
    except type(by) as error:
        return error


@pytest.mark.parametrize("error", [RuntimeError("cause"), ImportError("context")])
def test_ctrl_c_is_known_behind_other_errors(error):
    assert was_ctrl_c(_hidden(error))
    assert was_ctrl_c(KeyboardInterrupt())
    assert not was_ctrl_c(type(error)())
    assert not was_ctrl_c(None)


def test_a_library_stopped_while_it_loads_is_no_traceback(monkeypatch, capsys):
    def loading(*_, **__):
        raise _hidden(RuntimeError("cause"))

    monkeypatch.setattr(module, "app", loading)
    assert module.main(["info"]) == 130
    assert "Stopped" in capsys.readouterr().err


def test_another_error_is_not_taken_for_ctrl_c(monkeypatch):
    def failing(*_, **__):
        raise RuntimeError("a defect")

    monkeypatch.setattr(module, "app", failing)
    with pytest.raises(RuntimeError, match="a defect"):
        module.main(["info"])

"""Processes of foreign FMUs that are copies of a template: they have no more than a program of their own has."""

import gc
import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.isolated_component import IsolatedComponent
from orchestrator.devices.sandbox import copied_process, foreign_process
from orchestrator.devices.sandbox.copied_process import end_templates, template_processes
from orchestrator.devices.sandbox.passed_environment import environment
from orchestrator.devices.sandbox.process_tree import descendants
from tests.devices.acceptance.gallery.build import build
from tests.devices.sandbox.evil import evil

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the sandbox is Linux's")

WORKER = "orchestrator.devices.fmi.isolated_component_worker"


@pytest.fixture(scope="module", autouse=True)
def no_other_templates():
    """Those for other variables of the environment, which another module left."""
    end_templates()


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return read_description(build(evil("OWN_FILES"), tmp_path_factory.mktemp("template")))


def supervisor(component):
    return component._process._process.pid


def worker(component):
    return descendants(supervisor(component))[1]


def of(process, name):
    return Path(f"/proc/{process}/{name}").read_text(encoding="utf-8")


def status(process):
    """What stands in a process's status under some names, which are the same for all that are alike."""
    names = r"Uid|Gid|Groups|Umask|Cpus_allowed|NoNewPrivs|Seccomp|Seccomp_filters|Cap\w+|Sig(?:Blk|Ign)"
    return re.findall(rf"^(?:{names}):.*$", of(process, "status"), re.M)


def descriptors(process, folder):
    """What a process has open: the numbers of pipes and the like are left out."""
    opened = Path(f"/proc/{process}/fd").iterdir()
    found = [os.readlink(handle).replace(str(folder), "FOLDER") for handle in opened]
    return sorted(re.sub(r"\[\d+\]", "[]", text) for text in found)


def seen(component):
    """What its supervisor and its worker have of the machine and of gfor."""
    folder, found = component._process.folder, []
    for process in (supervisor(component), worker(component)):
        limits = of(process, "limits")
        kept = re.sub(r"^Max address space.*$", "", limits, flags=re.M)  # by what it has in use
        found.append(
            {
                "status": status(process),
                "descriptors": descriptors(process, folder),
                "environment": sorted(of(process, "environ").split("\0")),
                "limits": kept,
                "folder": os.readlink(f"/proc/{process}/cwd").replace(str(folder), "FOLDER"),
                "priority": os.getpriority(os.PRIO_PROCESS, process),
                "own": [
                    os.readlink(f"/proc/{process}/ns/{kind}")
                    != os.readlink(f"/proc/self/ns/{kind}")
                    for kind in ("user", "pid", "net", "mnt", "ipc")
                ],
                "leads a session": os.getsid(supervisor(component)) == supervisor(component),
            }
        )
    return found, component.protections


def holds(process, text):
    """Whether a text stands in the memory that a process alone has."""
    with open(f"/proc/{process}/mem", "rb") as memory:
        for line in of(process, "maps").splitlines():
            place, rights, *_ = line.split()
            if not rights.startswith("rw") or "[v" in line:
                continue
            begin, end = (int(number, 16) for number in place.split("-"))
            memory.seek(begin)
            if text in memory.read(end - begin):
                return True
    return False


def test_copies_are_children_of_gfor_in_sessions_of_their_own(fmu):
    with IsolatedComponent("a", fmu) as one, IsolatedComponent("b", fmu) as other:
        (template,) = template_processes()
        for component in (one, other):
            process = supervisor(component)
            assert f"PPid:\t{os.getpid()}\n" in of(process, "status")
            assert os.getsid(process) == process
        assert not descendants(template)


def test_a_copy_has_what_a_program_of_its_own_has(fmu, monkeypatch):
    copied_and_alone(fmu, monkeypatch)


def copied_and_alone(fmu, monkeypatch):
    """What a copy has of the machine and of gfor, held against what a program of its own has."""
    with IsolatedComponent("a", fmu) as component:
        assert isinstance(component._process._process, copied_process.CopiedProcess)
        copied = seen(component)
    with monkeypatch.context() as patch:
        patch.setattr(foreign_process, "start_copy", lambda *_: None)
        with IsolatedComponent("a", fmu) as component:
            assert isinstance(component._process._process, subprocess.Popen)
            assert copied == seen(component)
    return copied


@pytest.fixture
def after_it_narrowed_itself():
    """gfor gives up something that a template which had begun before still has, for the time of a test."""
    files, processors = resource.getrlimit(resource.RLIMIT_NOFILE), os.sched_getaffinity(0)
    mask, interrupt = os.umask(0), signal.getsignal(signal.SIGINT)

    def narrow():
        os.umask(0o077)
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(200, files[0]), files[1]))
        os.sched_setaffinity(0, {min(processors)})
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    os.umask(mask)
    yield narrow
    os.umask(mask)
    resource.setrlimit(resource.RLIMIT_NOFILE, files)
    os.sched_setaffinity(0, processors)
    signal.signal(signal.SIGINT, interrupt)
    end_templates()


def test_what_gfor_gives_up_the_next_fmu_does_not_have(fmu, monkeypatch, after_it_narrowed_itself):
    before = copied_and_alone(fmu, monkeypatch)
    after_it_narrowed_itself()
    assert before != copied_and_alone(fmu, monkeypatch)


def test_a_component_that_was_dropped_leaves_no_process(fmu):
    dropped = IsolatedComponent("a", fmu)
    process = supervisor(dropped)
    dropped._process._process.stdin.close()  # as the end of the object does
    wait_until(lambda: "State:\tZ" in of(process, "status"))
    del dropped
    gc.collect()
    with IsolatedComponent("b", fmu):
        assert not Path(f"/proc/{process}").exists()


def wait_until(reached):
    end = time.monotonic() + 10.0
    while not reached():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_the_template_knows_nothing_of_an_fmu(fmu):
    name = str(fmu.path.parent).encode()
    with IsolatedComponent("a", fmu) as component:
        (template,) = template_processes()
        assert holds(worker(component), name)
        assert not holds(template, name)
        assert sorted(of(template, "environ").split("\0")) == sorted(
            ["", *(f"{name}={value}" for name, value in environment().items())]
        )


def test_the_template_has_one_thread_and_no_random_numbers(fmu):
    """Each copy would draw the same ones of numpy's; Python's are drawn anew in each."""
    with IsolatedComponent("a", fmu):
        (template,) = template_processes()
        assert "Threads:\t1\n" in of(template, "status")
        assert "_multiarray_umath" in of(template, "maps")
        assert "_mt19937" not in of(template, "maps")


def test_where_a_template_has_ended_there_is_a_new_one(fmu):
    with IsolatedComponent("a", fmu):
        (first,) = template_processes()
    os.kill(first, signal.SIGKILL)
    with IsolatedComponent("a", fmu) as component:
        (second,) = template_processes()
        assert second != first
        assert component.values(["gain"]) == {"gain": 1.0}


def test_after_an_interrupt_the_next_answer_is_not_taken_for_another_question(fmu, monkeypatch):
    with IsolatedComponent("a", fmu):
        (first,) = template_processes()

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(copied_process._Template, "copy", interrupted)
        with pytest.raises(KeyboardInterrupt):
            IsolatedComponent("a", fmu)
    assert first not in template_processes()
    with IsolatedComponent("a", fmu) as component:
        assert component.values(["gain"]) == {"gain": 1.0}


def test_a_process_with_a_second_thread_is_not_copied(tmp_path):
    """Landlock would not bind that thread."""
    (tmp_path / "sitecustomize.py").write_text(
        "import threading\nthreading.Thread(target=threading.Event().wait, daemon=True).start()\n",
        encoding="utf-8",
    )
    search = [str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])]
    variables = {**environment(), "PYTHONPATH": os.pathsep.join(search)}
    templates = copied_process._Templates()
    with open(os.devnull, "rb") as nothing:
        for _ in range(2):
            assert templates.copy(WORKER, variables, 4 * [nothing.fileno()]) == 0
            assert not templates.processes()  # the second time nobody is asked


def test_a_copy_of_gfor_asks_no_template_of_gfors(fmu):
    with IsolatedComponent("a", fmu):
        assert template_processes()
        copy = os.fork()
        if not copy:
            os._exit(len(template_processes()))
        assert os.waitpid(copy, 0)[1] == 0


def test_how_it_ended_is_known(fmu):
    with IsolatedComponent("a", fmu) as component:
        os.kill(worker(component), signal.SIGSEGV)
        assert component._process.wait(60.0)
        assert component._process._process.returncode == -signal.SIGSEGV

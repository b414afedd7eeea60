"""Fixtures of running FMUs."""

import shutil

import fmpy
import pytest

from tests.support.host import Host


@pytest.fixture(scope="session")
def extracted(fmu_path):
    folders = {}

    def extract(name, native=False):
        if (name, native) not in folders:
            folders[name, native] = str(fmpy.extract(str(fmu_path(name, native))))
        return folders[name, native]

    yield extract
    for folder in folders.values():
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def open_host(extracted):
    """Open instances (name, instance, native); they are closed in the end."""
    open_hosts = []

    def create(name="gfor", instance="one", native=False):
        open_hosts.append(Host(extracted(name, native), instance))
        return open_hosts[-1]

    yield create
    for instance in open_hosts:
        instance.close()


@pytest.fixture(params=[False, True], ids=["python-backed", "native"])
def host(request, open_host):
    """Open instances of one kind of FMU; a test that uses it is run for both kinds."""
    return lambda name="gfor", instance="one": open_host(name, instance, request.param)

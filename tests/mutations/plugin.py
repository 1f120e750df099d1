"""A pytest plugin for runs with a fault: Hypothesis does not look for a simpler example once it has found one."""

import pytest
from hypothesis import Phase, settings


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    phases = (Phase.explicit, Phase.generate)
    settings.register_profile("mutations", settings.get_profile("eomgen"), phases=phases, database=None)
    settings.load_profile("mutations")

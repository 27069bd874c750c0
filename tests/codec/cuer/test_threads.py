import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

from codec.cuer.models.threads import one_thread


def threads() -> list[int]:
    return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]


def test_linear_algebra_keeps_to_one_thread_and_the_limit_is_taken_back() -> None:
    np.eye(2) @ np.eye(2)
    with threadpool_limits(limits=2, user_api="blas"):
        before = threads()
        assert before
        assert set(one_thread(threads)()) == {1}
        assert threads() == before

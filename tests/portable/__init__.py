"""``SLIDEVIZ_TESTS=portable``: tests under the rules of Windows, on the system that there is."""

POSIX_ONLY = {
    "test_a_signal_leaves_nothing": "drafts that are open stay until the next command",
    "test_a_copy_is_the_same_where_the_system_cannot_copy_by_itself": "it takes away what is gone",
    "test_of_two_sweeps_in_a_folder_the_second_is_refused": "the lock removes its own file",
    "test_a_screen_that_is_not_there_is_told": "there always is a screen",
    "test_no_worker_heeds_ctrl_c_while_it_starts": "there is no mask of signals",
}
"""Tests of what other systems do otherwise, and how."""

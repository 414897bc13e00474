!> The program without messages between processes: there is one rank.
#ifndef PERIFORT_MPI
submodule(pd_comm_world) alone
  use pd_base_error, only: internal_fault
  implicit none (type, external)

contains

  module procedure begin_world
    world%rank = 0
    world%ranks = 1
  end procedure begin_world

  module procedure end_world
  end procedure end_world

  module procedure abort_world
    associate (unused_status => status)  ! who calls ends by itself
    end associate
  end procedure abort_world

  module procedure reports_error
    reports = .true.
    if (world%ranks > 1) call internal_fault('there is no other rank')
  end procedure reports_error

  module procedure add_all
    if (self%ranks > 1 .and. size(values) > 0) call internal_fault('there is no other rank')
  end procedure add_all

  module procedure take_largest
    if (self%ranks > 1 .and. size(values) > 0) call internal_fault('there is no other rank')
  end procedure take_largest

  module procedure start_sharing
    if (self%ranks > 1 .and. size(values) + which > 0) call internal_fault('there is no other rank')
  end procedure start_sharing

  module procedure finish_sharing
    if (self%ranks > 1 .and. size(values) + which > 0) call internal_fault('there is no other rank')
  end procedure finish_sharing

  module procedure join
    if (size(owner) + size(number) + size(slot) > 0 .or. self%ranks > 1 &
      & .or. size(owned_number) /= size(owned_slot)) call internal_fault('there is no other rank')
  end procedure join

  module procedure collect
    all_values = values
    if (self%ranks > 1) call internal_fault('there is no other rank')
  end procedure collect

  module procedure find_handles
    ranks = -1
    no_hints = -1
  end procedure find_handles

  module procedure deal
    got = values
    if (self%ranks > 1 .or. size(given) /= 1) call internal_fault('there is no other rank')
    if (present(taken)) then
      if (any(taken /= given)) call internal_fault('a rank takes other values than it gives')
    end if
  end procedure deal

  module procedure number_before
    if (self%ranks > 1 .or. number < 0_i8) call internal_fault('there is no other rank')
    before = 0_i8
  end procedure number_before

  module procedure wait_for_all
    if (self%ranks > 1) call internal_fault('there is no other rank')
  end procedure wait_for_all

end submodule alone
#endif

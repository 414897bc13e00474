!> What of a system in motion must be kept, so that it can continue after a restart with the same
!> bits, and a checksum of what must be there before that: all else follows from the scene.
module pd_motion_keep
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc
  use pd_base_archive, only: archive_type
  use pd_base_checksum, only: checksum_type
  use pd_base_kinds, only: wp, i1, i8
  use pd_force_generic_points, only: keep_laws
  use pd_motion_conditions, only: keep_paths, keep_poses
  use pd_motion_heating, only: keep_heating
  use pd_motion_memory, only: keep_memory
  use pd_motion_rigid_body, only: keep_body
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: keep_system, checksum_of_start

contains

  !> Keep the system as it is after the forces of an instant, or put it back into one that was made
  !> from the same scene. Forces are kept, too, since those of points that just lost a bond come
  !> from another formula; `p` is not, since every evaluation begins with it.
  subroutine keep_system(archive, system)
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    type(system_type), intent(inout) :: system  !! set where the archive reads, else left as it is
    real(wp), allocatable :: reactions(:, :)
    integer :: m

    call archive%keep('displacement', system%state%u)
    call archive%keep('velocity', system%state%v)
    call archive%keep('force', system%state%force)
    if (system%levels > 0) then
      call archive%keep('force beyond', system%beyond)
      call archive%keep('goes beyond', system%goes_beyond)
    end if
    call archive%keep('damage', system%state%damage)
    call archive%keep('strained', system%strained)
    call system%family%keep_bonds(archive)
    call archive%keep('broken bonds', system%broken)
    call archive%keep('dissipated energy', system%dissipated)
    call keep_laws(archive, system%family, system%workspace%generic)
    call archive%keep('plastic energy', system%plastic_energy)
    call archive%keep('external work', system%external_work)
    call archive%keep('dissipation due', system%dissipation_due)
    call archive%keep('work due', system%work_due)
    call archive%keep('last place', system%last_u)
    call archive%keep('last force', system%last_force)
    call archive%keep('last velocity', system%last_v)
    call archive%keep('loaded and held', system%loaded_and_held)
    allocate (reactions(6, size(system%motions)))
    do m = 1, size(system%motions)
      reactions(:, m) = [system%motions(m)%reaction, system%motions(m)%moment]
    end do
    call archive%keep('reactions', reactions)
    do m = 1, size(system%motions)
      system%motions(m)%reaction = reactions(:3, m)
      system%motions(m)%moment = reactions(4:, m)
    end do
    if (allocated(system%heating%curves)) &
      & call keep_heating(archive, system%heating, system%model%expansion)
    call keep_paths(archive, system%motions)
    call keep_poses(archive, system%motions)
    do m = 1, size(system%rigid_bodies)
      call keep_body(archive, m, system%rigid_bodies(m), system%obstacles(m))
    end do
    call system%terms%keep(archive)
    call keep_memory(archive, system%memory)
  end subroutine keep_system

  !> A checksum of points and initial state, which may come from files that the scene names, and of
  !> their order in memory. To be taken before the first step.
  integer(i8) function checksum_of_start(system) result(value)
    type(system_type), intent(in) :: system  !! ready, before the first step
    type(checksum_type) :: checksum
    integer :: c

    do c = 1, system%body%dim
      call add(system%body%x(:, c))
      call add(system%state%u(:, c))
      call add(system%state%v(:, c))
    end do
    call add(system%body%volume)
    if (allocated(system%heating%full)) then
      call add(system%heating%full)
    else if (allocated(system%model%expansion)) then
      call add(system%model%expansion)
    end if
    value = checksum%value()

  contains

    subroutine add(values)
      real(wp), contiguous, target, intent(in) :: values(:)
      integer(i1), pointer, contiguous :: bytes(:)
      if (size(values) == 0) return
      call c_f_pointer(c_loc(values), bytes, [8_i8*size(values, kind=i8)])
      call checksum%add(bytes)
    end subroutine add
  end function checksum_of_start

end module pd_motion_keep

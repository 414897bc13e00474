!> What of a system in motion must be kept, so that it can continue after a restart with the same
!> bits, and a checksum of what must be there before that: all else follows from the scene.
module pd_motion_keep
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc
  use pd_base_archive, only: archive_type, joined, of_slots, same
  use pd_base_checksum, only: checksum_type, parts_of, value_of
  use pd_base_error, only: fail
  use pd_base_kinds, only: wp, i1, i8
  use pd_base_order, only: ascending_order, number_of, place_in
  use pd_base_text, only: to_text
  use pd_body_body, only: body_type, number_at, owned
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_generic_points, only: keep_laws
  use pd_motion_account, only: rows_of_work
  use pd_motion_conditions, only: keep_paths, keep_poses
  use pd_motion_heating, only: keep_heating
  use pd_motion_memory, only: keep_memory
  use pd_motion_rigid_body, only: keep_body
  use pd_motion_system, only: system_type
  implicit none (type, external)
  private
  public :: keep_system, checksum_of_start, checksum_of_points

contains

  !> Keep the system as it is after the forces of an instant, or put it back into one that was made
  !> from the same scene. Forces are kept, too, since those of points that just lost a bond come
  !> from another formula; `p` is not, since every evaluation begins with it.
  subroutine keep_system(archive, system)
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    type(system_type), intent(inout) :: system  !! set where the archive reads, else left as it is
    real(wp), allocatable :: reactions(:, :)
    integer :: m

    if (archive%merges .and. system%model%generic) call fail(archive%error, 'what laws with a '// &
      & 'history keep is for the same number of ranks only')
    call name_slots(archive, system%body)
    call archive%over(of_slots)
    call archive%keep('displacement', system%state%u)
    call archive%keep('velocity', system%state%v)
    call archive%keep('force', system%state%force)
    if (system%levels > 0) call archive%keep('force beyond', system%beyond)
    call archive%keep('damage', system%state%damage)
    call archive%keep('strained', system%strained)
    call archive%over(same)
    if (system%levels > 0) call archive%keep('goes beyond', system%goes_beyond)
    call keep_links(archive, system)
    call archive%keep('broken bonds', system%broken)
    call archive%keep('dissipated energy', system%dissipated)
    call keep_laws(archive, system%family, system%workspace%generic)
    call archive%keep('plastic energy', system%plastic_energy)
    call archive%keep('external work', system%external_work)
    call archive%keep('dissipation due', system%dissipation_due)
    call archive%keep('work due', system%work_due)
    call keep_work(archive, system)
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
    call keep_paths(archive, system%body, system%motions)
    call keep_poses(archive, system%motions)
    do m = 1, size(system%rigid_bodies)
      call keep_body(archive, m, system%rigid_bodies(m), system%obstacles(m))
    end do
    call system%terms%keep(archive)
    call keep_memory(archive, system%memory)
  end subroutine keep_system

  !> Name the points of the slots.
  subroutine name_slots(archive, body)
    class(archive_type), intent(inout) :: archive
    type(body_type), intent(in) :: body
    integer, allocatable :: slots(:)
    integer :: k

    if (archive%in_memory) return
    slots = [(k, k=1, body%n_slots)]
    call archive%name_rows(of_slots, number_at(body, slots), owned(body, slots))
  end subroutine name_slots

  !> Keep the places, forces and velocities of the account of work.
  subroutine keep_work(archive, system)
    class(archive_type), intent(inout) :: archive
    type(system_type), intent(inout) :: system
    integer(i8), allocatable :: keys(:)
    logical, allocatable :: own(:)

    if (.not. archive%in_memory) then
      call rows_of_work(system, keys, own)
      call archive%name_rows('work', keys, own)
    end if
    call archive%over('work')
    call archive%keep('last place', system%last_u)
    call archive%keep('last force', system%last_force)
    call archive%keep('last velocity', system%last_v)
    call archive%over(same)
  end subroutine keep_work

  !> Keep which bonds are broken: as the family has them, and in files also by the numbers of the
  !> points at their ends, from which ranks of another number break them.
  subroutine keep_links(archive, system)
    class(archive_type), intent(inout) :: archive
    type(system_type), intent(inout) :: system
    integer(i8), allocatable :: links(:, :)

    if (.not. archive%merges) call system%family%keep_bonds(archive)
    if (archive%in_memory) return
    if (.not. archive%reading) call find_links(system, links)
    call archive%over(joined)
    call archive%keep('ends of broken bonds', links)
    call archive%over(same)
    if (allocated(archive%error) .or. .not. archive%merges) return
    call break_links(archive, links(:, 1), system)
  end subroutine keep_links

  !> The broken bonds whose end with the lower number is this rank's.
  subroutine find_links(system, links)
    type(system_type), intent(in) :: system
    integer(i8), allocatable, intent(out) :: links(:, :)
      !! (any number, 1) a point's number with its sign changed, then the numbers of the points at
      !! the other ends, and so on
    integer(i8), allocatable :: list(:)
    type(bonds_type) :: bonds
    integer(i8) :: mine, other
    integer :: p, k, i, n, begins

    allocate (list(1024))
    n = 0
    call allocate_bonds(system%family, bonds)
    do p = 1, system%body%order%n_owned
      k = system%body%slot(p)
      if (.not. system%family%may_have_broken(k)) cycle
      mine = number_at(system%body, k)
      call system%family%bonds_of(k, bonds)
      if (n + bonds%n + 1 > size(list)) call grow(list, 2*(n + bonds%n + 1))
      begins = n
      n = n + 1
      list(n) = -mine
      do i = 1, bonds%n
        if (bonds%intact(i)) cycle
        other = number_at(system%body, int(bonds%j(i)))
        if (other < mine) cycle
        n = n + 1
        list(n) = other
      end do
      if (n == begins + 1) n = begins
    end do
    allocate (links(n, 1))
    links(:, 1) = list(:n)
  end subroutine find_links

  !> Make a list longer.
  pure subroutine grow(list, n)
    integer(i8), allocatable, intent(inout) :: list(:)
    integer, intent(in) :: n
    integer(i8), allocatable :: longer(:)

    allocate (longer(n))
    longer(:size(list)) = list
    call move_alloc(longer, list)
  end subroutine grow

  !> Break bonds of which both ends are here, from both.
  subroutine break_links(archive, links, system)
    class(archive_type), intent(inout) :: archive  !! whose `error` is set if there is no such bond
    integer(i8), intent(in) :: links(:)            !! as from `find_links`
    type(system_type), intent(inout) :: system
    type(bonds_type) :: bonds
    integer(i8), allocatable :: numbers(:)
    integer, allocatable :: order(:)
    integer :: e, p, a, b

    if (size(links) == 0) return
    if (size(system%state%damage) == 0) then
      call fail(archive%error, 'the checkpoint has broken bonds, and no bond can break here')
      return
    end if
    numbers = [(number_at(system%body, int(system%body%slot(p))), p=1, system%body%n_points)]
    order = ascending_order(numbers)
    numbers = numbers(order)
    call allocate_bonds(system%family, bonds)
    a = 0
    do e = 1, size(links)
      if (links(e) < 0_i8) then
        a = slot_of(-links(e))
        cycle
      end if
      if (a == 0) cycle
      b = slot_of(links(e))
      if (b == 0) cycle
      call break_end(a, b)
      call break_end(b, a)
      if (allocated(archive%error)) return
    end do

  contains

    !> The slot of a point; 0 if it is not here.
    integer function slot_of(number) result(slot)
      integer(i8), intent(in) :: number
      slot = place_in(numbers, number)
      if (slot > 0) slot = system%body%slot(order(slot))
    end function slot_of

    !> Break the bond of slot `k` to slot `j`.
    subroutine break_end(k, j)
      integer, intent(in) :: k, j
      integer :: i

      call system%family%bonds_of(k, bonds)
      i = findloc(bonds%j(:bonds%n), j, dim=1)
      if (i > 0) then
        call system%family%break_bond(k, i)
      else if (owned(system%body, k)) then
        call fail(archive%error, 'the checkpoint has a broken bond between the points '// &
          & to_text(number_at(system%body, k))//' and '//to_text(number_at(system%body, j))// &
          & ', which have none here')
      end if
    end subroutine break_end
  end subroutine break_links

  !> A checksum of points and initial state that is the same on any number of ranks. All ranks must
  !> call it, before the first step.
  integer(i8) function checksum_of_points(system) result(value)
    type(system_type), intent(in) :: system  !! ready, before the first step
    type(checksum_type) :: checksum
    real(wp), target :: values(3*system%body%dim + 3)
    integer(i1), pointer, contiguous :: bytes(:)
    real(wp) :: parts(4)
    integer :: p, k

    call c_f_pointer(c_loc(values), bytes, [8_i8*size(values, kind=i8)])
    parts = 0.0_wp
    values = 0.0_wp
    do p = 1, system%body%order%n_owned
      k = system%body%slot(p)
      values(1) = transfer(number_of(system%body%order, p), 0.0_wp)
      values(2) = system%body%volume(k)
      if (allocated(system%heating%full)) then
        values(3) = system%heating%full(k)
      else if (allocated(system%model%expansion)) then
        values(3) = system%model%expansion(k)
      end if
      values(4:) = [system%body%x(k, :), system%state%u(k, :), system%state%v(k, :)]
      call checksum%begin_again()
      call checksum%add(bytes)
      parts = parts + parts_of(checksum%value())
    end do
    if (associated(system%body%order%ranks)) call system%body%order%ranks%add_all(parts)
    value = value_of(parts)
  end function checksum_of_points

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

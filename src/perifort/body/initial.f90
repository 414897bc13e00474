!> Initial state (7.8): displacement, velocity and temperature change of every point.
module pd_body_initial
  use pd_base_kinds, only: wp, i2, i4, i8
  use pd_base_error, only: error_type
  use pd_base_order, only: ascending_order
  use pd_base_text, only: to_text
  use pd_scene_content_types, only: scene_type, is_given, is_set
  use pd_scene_format_file, only: resolve_path
  use pd_scene_content_expressions, only: varies_in_time
  use pd_scene_content_rules, only: place_fault, scene_fault
  use pd_scene_format_given, only: name_length
  use pd_scene_format_pieces, only: find_pieces, piece_type, read_piece
  use pd_scene_format_table, only: table_type
  use pd_body_body, only: body_type, number_at
  use pd_body_choice, only: values_on
  use pd_body_regions, only: region_mask
  implicit none (type, external)
  private
  public :: initial_state

  character(*), parameter :: xyz = 'xyz'

contains

  !> The groups are applied in order; each sets the values it gives. The temperature change of a
  !> group in which it depends on t is 1 K: what it is multiplied with is the group's heating. An
  !> error if a file of initial values cannot be read or does not have a row for each point, or if
  !> the value of an expression is not finite.
  subroutine initial_state(scene, body, u, v, temperature_change, heated_by, error)
    type(scene_type), intent(in) :: scene  !! gives the groups and their regions
    type(body_type), intent(in) :: body                          !! arranged in slots
    real(wp), allocatable, intent(out) :: u(:, :)                !! displacement (n_slots, dim) [m]
    real(wp), allocatable, intent(out) :: v(:, :)                !! velocity (n_slots, dim) [m/s]
    real(wp), allocatable, intent(out) :: temperature_change(:)  !! of each slot [K]
    integer(i2), allocatable, intent(out) :: heated_by(:)        !! number of the `&initial` that
                                                                 !! heats each slot, or 0
    type(error_type), allocatable, intent(out) :: error          !! of a file of initial values
    logical, allocatable :: chosen(:)
    integer(i4), allocatable :: slots(:)
    real(wp), allocatable :: values(:)
    integer :: i, k

    allocate (u(body%n_slots, body%dim), v(body%n_slots, body%dim), source=0.0_wp)
    allocate (temperature_change(body%n_slots), source=0.0_wp)
    allocate (heated_by(body%n_slots), source=0_i2)
    do i = 1, size(scene%initial)
      associate (group => scene%initial(i))
        if (group%file /= '') then
          call state_from_file(scene, i, body, u, v, temperature_change, heated_by, error)
          if (allocated(error)) return
          cycle
        end if
        chosen = body%point > 0
        if (group%region /= '') chosen = chosen .and. region_mask(scene, body, group%region)
        slots = pack([(int(k, i4), k=1, body%n_slots)], chosen)
        call set_field(scene, i, 'displacement', body, slots, group%displacement, &
          & group%displacement_text, group%displacement_gradient, u, error)
        if (allocated(error)) return
        call set_field(scene, i, 'velocity', body, slots, group%velocity, group%velocity_text, &
          & group%velocity_gradient, v, error)
        if (allocated(error)) return
        if (.not. is_given(group%temperature_change, group%temperature_text)) cycle
        heated_by(slots) = int(i, i2)
        if (group%temperature_text == '') then
          temperature_change(slots) = group%temperature_change
        else if (varies_in_time(scene, group%temperature_text)) then
          temperature_change(slots) = 1.0_wp
        else
          call values_on(scene, group%temperature_text, body, slots, 'initial', i, &
            & 'temperature_change', values, error)
          if (allocated(error)) return
          temperature_change(slots) = values
        end if
      end associate
    end do
  end subroutine initial_state

  !> Components that the group names become value + H x.
  subroutine set_field(scene, number, key, body, slots, value, text, gradient, field, error)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    character(*), intent(in) :: key
    type(body_type), intent(in) :: body
    integer(i4), intent(in) :: slots(:)
    real(wp), intent(in) :: value(3), gradient(3, 3)
    character(*), intent(in) :: text(3)
    real(wp), intent(inout) :: field(:, :)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:)
    integer :: c, i

    do c = 1, body%dim
      if (.not. is_given(value(c), text(c)) .and. all(abs(gradient(c, :)) <= 0.0_wp)) cycle
      if (text(c) /= '') then
        call values_on(scene, text(c), body, slots, 'initial', number, key//'_'//xyz(c:c), values, &
          & error)
        if (allocated(error)) return
      else
        values = spread(merge(value(c), 0.0_wp, is_set(value(c))), 1, size(slots))
      end if
      do i = 1, size(slots)
        field(slots(i), c) = values(i) + dot_product(gradient(c, :body%dim), body%x(slots(i), :))
      end do
    end do
  end subroutine set_field

  !> Columns of a table, one row per point in the order of the results.
  subroutine state_from_file(scene, number, body, u, v, temperature_change, heated_by, error)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: number
    type(body_type), intent(in) :: body
    real(wp), intent(inout) :: u(:, :), v(:, :), temperature_change(:)
    integer(i2), intent(inout) :: heated_by(:)
    type(error_type), allocatable, intent(out) :: error
    character(18), parameter :: known(7) = [character(18) :: 'displacement_x', 'displacement_y', &
      & 'displacement_z', 'velocity_x', 'velocity_y', 'velocity_z', 'temperature_change']
    integer, parameter :: most = 32768  ! rows that are in memory at once
    character(:), allocatable :: path
    character(name_length), allocatable :: names(:)
    type(piece_type), allocatable :: pieces(:)
    type(table_type) :: table
    integer(i4), allocatable :: slots(:)
    integer(i8) :: points, rows, before
    integer :: p, next, first

    path = resolve_path(trim(scene%initial(number)%file), scene%file)
    call find_pieces(path, most, pieces, error)
    call place_fault(error, scene, 'initial', number, 'file')
    if (allocated(error)) return
    points = int(body%n_points, i8)
    if (associated(body%order%ranks)) points = body%order%n_global
    rows = sum(int(pieces%rows, i8)) - 1
    slots = pack([(int(p, i4), p=1, body%n_slots)], body%point > 0)
    slots = slots(ascending_order(number_at(body, slots)))
    before = 0_i8
    next = 1
    do p = 1, size(pieces)
      ! the first row is the header
      first = next
      do while (next <= size(slots))
        if (number_at(body, slots(next)) > before + pieces(p)%rows - merge(1, 0, p == 1)) exit
        next = next + 1
      end do
      if (p == 1) then
        call read_piece(path, pieces(p), table, error, allowed=pack(known, of_dimension(body%dim)))
      else if (next > first) then
        call read_piece(path, pieces(p), table, error, columns=size(names))
      end if
      call place_fault(error, scene, 'initial', number, 'file')
      if (.not. allocated(error) .and. rows /= points) call scene_fault(error, scene, 'initial', &
        & number, 'file', 'the initial state in '//path//' has '//to_text(rows)//' rows, but '// &
        & 'the scene has '//to_text(points)//' points (layers included)', &
        & 'one row per point is expected, in the order of the results')
      if (allocated(error)) return
      if (p == 1) names = table%names
      call take_rows(slots(first:next - 1))
      before = before + pieces(p)%rows - merge(1, 0, p == 1)
    end do

  contains

    !> Give slots, copies included, the values of their rows.
    subroutine take_rows(here)
      integer(i4), intent(in) :: here(:)  !! with points of this piece
      integer :: i, column, which, row

      do column = 1, size(names)
        which = findloc(known == names(column), .true., dim=1)
        do i = 1, size(here)
          row = int(number_at(body, here(i)) - before)
          select case (which)
          case (1:3)
            u(here(i), which) = table%values(column, row)
          case (4:6)
            v(here(i), which - 3) = table%values(column, row)
          case default  ! the last of the known names
            temperature_change(here(i)) = table%values(column, row)
            heated_by(here(i)) = int(number, i2)
          end select
        end do
      end do
    end subroutine take_rows
  end subroutine state_from_file

  !> Which columns a dimension has.
  pure function of_dimension(dim) result(has)
    integer, intent(in) :: dim
    logical :: has(7)
    has = [.true., dim > 1, dim > 2, .true., dim > 1, dim > 2, .true.]
  end function of_dimension

end module pd_body_initial

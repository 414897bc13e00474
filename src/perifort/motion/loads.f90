!> External loads (7.8; doc/theory.md, 10): force densities that vary with a course in time, and
!> parts that are expressions of position and time.
module pd_motion_loads
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_expression, only: expression_type
  use pd_base_field, only: field_type, field_values, new_field
  use pd_base_kinds, only: wp, i4
  use pd_force_term, only: force_term_type, term_view_type, no_stiffness
  use pd_force_terms, only: term_list_type
  use pd_motion_conditions, only: condition_fault, note_fault
  use pd_motion_curve, only: curve_type
  implicit none (type, external)
  private
  public :: load_type, add_loads_to, number_of_loads, load_of, other_terms, add_part, &
    & acts_along, density_of, renew_load

  real(wp), parameter :: never = -huge(1.0_wp)

  !> A part of a load that is an expression of t.
  type :: load_part_type
    type(field_type) :: field
    integer :: component = 0
    real(wp), allocatable :: weight(:)      !! of each slot
    character(:), allocatable :: key        !! that has the expression
  end type load_part_type

  !> External force density on some slots: the plainest term of the force.
  type, extends(force_term_type) :: load_type
    integer(i4), allocatable :: slots(:)
    real(wp), allocatable :: density(:, :)  !! at factor 1 (slot, dim) [N/m3]
    type(curve_type) :: curve
    type(load_part_type), allocatable :: parts(:)  !! to be added to `density`; the factor is then 1
    logical :: acts(3) = .true.             !! whether components are not all 0
    integer, allocatable :: on_held(:)      !! which of its slots have constrained components
    real(wp) :: time = never                !! of `now` [s]
    real(wp), allocatable :: now(:, :)      !! density with its parts (slot, dim) [N/m3]
  contains
    procedure :: add_force => add_force_of_load
    procedure :: add_energy => add_no_energy
    procedure :: add_stiffness_bound => add_no_bound
    procedure :: keep => keep_nothing
    procedure :: describe => describe_load
  end type load_type

contains

  !> Put loads into a list of terms, before all others but the bonds.
  subroutine add_loads_to(terms, loads)
    type(term_list_type), intent(inout) :: terms
      !! without terms other than bonds and loads; with these loads at its end on return
    type(load_type), intent(inout) :: loads(:)
      !! (any number) external, without stiffness and summed apart on return
    integer :: l, c, i

    if (other_terms(terms) > 0) call internal_fault('loads come first')
    do l = 1, size(loads)
      do c = 1, size(loads(l)%density, 2)
        loads(l)%acts(c) = any(abs(loads(l)%density(:, c)) > 0.0_wp)
      end do
      if (allocated(loads(l)%parts)) then
        do i = 1, size(loads(l)%parts)
          loads(l)%acts(loads(l)%parts(i)%component) = .true.
        end do
      end if
      loads(l)%external = .true.
      loads(l)%tangent = no_stiffness
      loads(l)%summed_apart = .true.
      call terms%add(loads(l))
    end do
  end subroutine add_loads_to

  !> How many loads a list of terms has; they follow the bonds.
  pure integer function number_of_loads(terms) result(number)
    type(term_list_type), intent(in) :: terms  !! with its loads before other terms
    integer :: i

    number = 0
    do i = 1, terms%number()
      select type (term => terms%items(i)%term)
      type is (load_type)
        number = number + 1
      class default  ! another term
        continue
      end select
    end do
  end function number_of_loads

  !> How many terms a list has that are neither the bonds nor loads.
  pure integer function other_terms(terms) result(number)
    type(term_list_type), intent(in) :: terms  !! with its loads before other terms

    number = terms%number() - terms%bonds - number_of_loads(terms)
  end function other_terms

  !> The `l`-th load of a list of terms. It is the term itself, not a copy.
  function load_of(terms, l) result(load)
    type(term_list_type), intent(in), target :: terms  !! with its loads before other terms
    integer, intent(in) :: l
      !! number of the load, from 1; that of another term is a fault of the program
    type(load_type), pointer :: load

    load => null()
    select type (term => terms%items(terms%bonds + l)%term)
    type is (load_type)
      load => term
    class default
      call internal_fault('a term is taken for a load')
    end select
  end function load_of

  !> The load's force density at the time of the view.
  subroutine add_force_of_load(self, view, force)
    class(load_type), intent(in) :: self      !! the load
    type(term_view_type), intent(in) :: view  !! whose time counts
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) force density, added to [N/m3]
    real(wp), allocatable :: density(:, :)
    real(wp) :: factor
    integer :: c, i

    factor = self%curve%value(view%time)
    if (allocated(self%parts)) then
      call density_of(self, view%time, density)
    else
      density = self%density
    end if
    do c = 1, size(force, 2)
      do i = 1, size(self%slots)
        force(self%slots(i), c) = force(self%slots(i), c) + factor*density(i, c)
      end do
    end do
  end subroutine add_force_of_load

  !> A load stores nothing.
  subroutine add_no_energy(self, view, density)
    class(load_type), intent(in) :: self      !! the load
    type(term_view_type), intent(in) :: view  !! the instant
    real(wp), intent(inout), contiguous :: density(:)
      !! (n_slots) energy density, left as it is [J/m3]
    call must_be_load(self, view, density)
  end subroutine add_no_energy

  !> It doesn't depend on displacements.
  subroutine add_no_bound(self, view, bound)
    class(load_type), intent(in) :: self      !! the load
    type(term_view_type), intent(in) :: view  !! the instant
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the stiffness, left as it is [N/m4]
    call must_be_load(self, view, bound)
  end subroutine add_no_bound

  !> The interface gives what a load has no use for; it must be of the body that it acts on.
  subroutine must_be_load(self, view, values)
    class(load_type), intent(in) :: self
    type(term_view_type), intent(in) :: view
    real(wp), intent(in) :: values(:)
    if (size(self%slots) > size(values) .or. size(values) /= size(view%u, 1)) &
      & call internal_fault('a load on another body')
  end subroutine must_be_load

  !> Nor does it carry anything from one instant to the next.
  subroutine keep_nothing(self, archive)
    class(load_type), intent(inout) :: self        !! the load, left as it is
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    if (archive%reading .and. .not. allocated(self%slots)) call internal_fault('an empty load')
  end subroutine keep_nothing

  !> The report of a scene lists its loads.
  function describe_load(self) result(text)
    class(load_type), intent(in) :: self  !! the load
    character(:), allocatable :: text
    text = ''
    if (.not. self%external) text = 'a load outside the list of terms'
  end function describe_load

  !> Add a part to a load: `weight` times an expression of t, along one component.
  subroutine add_part(load, key, component, expression, x, weight)
    type(load_type), intent(inout) :: load           !! with its slots
    character(*), intent(in) :: key                  !! that has the expression
    integer, intent(in) :: component                 !! along which it acts
    type(expression_type), intent(in) :: expression  !! of x, y, z, t
    real(wp), intent(in) :: x(:, :)                  !! positions of its points (slot, dim) [m]
    real(wp), intent(in) :: weight(:)                !! (slot) force density at the value 1
    type(load_part_type), allocatable :: parts(:)
    integer :: n

    n = 0
    if (allocated(load%parts)) n = size(load%parts)
    allocate (parts(n + 1))
    if (n > 0) parts(:n) = load%parts
    parts(n + 1)%component = component
    parts(n + 1)%weight = weight
    parts(n + 1)%key = key
    call new_field(expression, x, parts(n + 1)%field)
    call move_alloc(parts, load%parts)
  end subroutine add_part

  !> Whether a load may act along component `c`.
  pure logical function acts_along(load, c) result(acts)
    type(load_type), intent(in) :: load  !! the load
    integer, intent(in) :: c             !! component
    acts = load%acts(c)
  end function acts_along

  !> Force densities at time `t` of a load that has parts; its factor is 1.
  subroutine density_of(load, t, density)
    class(load_type), intent(in) :: load                !! the load
    real(wp), intent(in) :: t                           !! time [s]
    real(wp), allocatable, intent(out) :: density(:, :)  !! (slot, dim) [N/m3]
    integer :: at, part

    if (abs(t - load%time) > 0.0_wp) then
      density = load%density
      call add_parts(load, t, density, at, part)
    else
      density = load%now
    end if
  end subroutine density_of

  !> Add the parts of a load at time `t`, but those that are not finite.
  subroutine add_parts(load, t, density, at_fault, part)
    class(load_type), intent(in) :: load
    real(wp), intent(in) :: t
    real(wp), intent(inout) :: density(:, :)
    integer, intent(out) :: at_fault, part   !! the first point and part that is not finite, 0: none
    real(wp) :: values(size(density, 1))
    integer :: i, at

    at_fault = 0
    part = 0
    do i = 1, size(load%parts)
      call field_values(load%parts(i)%field, t, values, at)
      if (at == 0) then
        associate (c => load%parts(i)%component)
          density(:, c) = density(:, c) + load%parts(i)%weight*values
        end associate
      else if (part == 0) then
        at_fault = at
        part = i
      end if
    end do
  end subroutine add_parts

  !> Bring the kept density of load `number` to time `t`. `fault` is allocated if it is not finite.
  subroutine renew_load(load, number, t, fault)
    type(load_type), intent(inout) :: load  !! gets `now`
    integer, intent(in) :: number           !! which load, for `fault`
    real(wp), intent(in) :: t               !! [s]
    type(condition_fault), allocatable, intent(inout) :: fault  !! the first one stays
    integer :: at, part

    if (.not. allocated(load%parts)) return
    load%now = load%density
    call add_parts(load, t, load%now, at, part)
    load%time = t
    if (at > 0) call note_fault('load', number, load%parts(part)%key, load%slots(at), t, fault)
  end subroutine renew_load

end module pd_motion_loads

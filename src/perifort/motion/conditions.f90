!> Boundary conditions (7.8; doc/theory.md, 10): imposed motion of points and external loads.
module pd_motion_conditions
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1, i4
  use pd_force_term, only: force_term_type, term_list_type, term_view_type, no_stiffness
  use pd_motion_curve, only: curve_type
  implicit none (type, external)
  private
  public :: motion_type, load_type, free_component, moved_by_displacement, moved_by_velocity
  public :: impose, remember_start, add_loads_to, number_of_loads, load_of

  integer, parameter :: free_component = 0
  integer, parameter :: moved_by_displacement = 1
  integer, parameter :: moved_by_velocity = 2

  !> Imposed motion of some slots.
  type :: motion_type
    character(:), allocatable :: name
    integer(i4), allocatable :: slots(:)
    integer :: kind(3) = free_component     !! what is imposed on each component
    real(wp) :: amplitude(3) = 0.0_wp       !! [m] or [m/s], times the curve
    type(curve_type) :: curve
    real(wp), allocatable :: start(:, :)    !! displacement at t = 0 (slot, dim) [m]
    integer(i1), allocatable :: held(:, :)  !! 1 where this motion holds, not a later one
    real(wp) :: reaction(3) = 0.0_wp        !! force the boundary exerts on the body [N]
  end type motion_type

  !> External force density on some slots: the plainest term of the force.
  type, extends(force_term_type) :: load_type
    integer(i4), allocatable :: slots(:)
    real(wp), allocatable :: density(:, :)  !! at factor 1 (slot, dim) [N/m3]
    type(curve_type) :: curve
  contains
    procedure :: add_force => add_force_of_load
    procedure :: add_energy => add_no_energy
    procedure :: add_stiffness_bound => add_no_bound
    procedure :: keep => keep_nothing
    procedure :: describe => describe_load
  end type load_type

contains

  !> Put loads into a list of terms, before all others.
  subroutine add_loads_to(terms, loads)
    type(term_list_type), intent(inout) :: terms
      !! without terms other than loads; with these loads at its end on return
    type(load_type), intent(inout) :: loads(:)
      !! (any number) external, without stiffness and summed apart on return
    integer :: l

    if (terms%number() > number_of_loads(terms)) call internal_fault('loads come first')
    do l = 1, size(loads)
      loads(l)%external = .true.
      loads(l)%tangent = no_stiffness
      loads(l)%summed_apart = .true.
      call terms%add(loads(l))
    end do
  end subroutine add_loads_to

  !> How many loads a list of terms begins with.
  pure integer function number_of_loads(terms) result(number)
    type(term_list_type), intent(in) :: terms  !! with its loads first
    integer :: i

    number = 0
    do i = 1, terms%number()
      select type (term => terms%items(i)%term)
      type is (load_type)
        number = i
      class default  ! another term
        continue
      end select
    end do
  end function number_of_loads

  !> The `l`-th load of a list of terms. It is the term itself, not a copy.
  function load_of(terms, l) result(load)
    type(term_list_type), intent(in), target :: terms  !! with its loads first
    integer, intent(in) :: l
      !! number of the load, from 1; that of another term is a fault of the program
    type(load_type), pointer :: load

    load => null()
    select type (term => terms%items(l)%term)
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
    real(wp) :: factor
    integer :: c, i

    factor = self%curve%value(view%time)
    do c = 1, size(force, 2)
      do i = 1, size(self%slots)
        force(self%slots(i), c) = force(self%slots(i), c) + factor*self%density(i, c)
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

  !> Keep the displacements at t = 0, from which imposed velocities integrate.
  pure subroutine remember_start(motions, u)
    type(motion_type), intent(inout) :: motions(:)  !! (any number) get `start`
    real(wp), intent(in) :: u(:, :)                 !! (n_slots, dim) displacements at t = 0 [m]
    integer :: m, c

    do m = 1, size(motions)
      if (.not. allocated(motions(m)%start)) &
        & allocate (motions(m)%start(size(motions(m)%slots), size(u, 2)))
      do c = 1, size(u, 2)
        motions(m)%start(:, c) = u(motions(m)%slots, c)
      end do
    end do
  end subroutine remember_start

  !> Set displacement and velocity of the constrained components at time `t` [s].
  pure subroutine impose(motions, t, u, v)
    type(motion_type), intent(in) :: motions(:)   !! (any number) with `start` and `held` set
    real(wp), intent(in) :: t  !! time; in relaxation 0 to 1 over the load steps [s]
    real(wp), intent(inout) :: u(:, :)            !! displacements (n_slots, dim) [m]
    real(wp), intent(inout), optional :: v(:, :)  !! velocities (n_slots, dim) [m/s]
    real(wp) :: factor, rate, path
    integer :: m, c, i

    do m = 1, size(motions)
      associate (motion => motions(m))
        if (all(motion%kind == free_component)) cycle
        factor = motion%curve%value(t)
        rate = motion%curve%slope(t)
        path = motion%curve%integral(t)
        do c = 1, size(u, 2)
          select case (motion%kind(c))
          case (moved_by_displacement)
            do i = 1, size(motion%slots)
              if (motion%held(i, c) == 0_i1) cycle
              u(motion%slots(i), c) = motion%amplitude(c)*factor
              if (present(v)) v(motion%slots(i), c) = motion%amplitude(c)*rate
            end do
          case (moved_by_velocity)
            do i = 1, size(motion%slots)
              if (motion%held(i, c) == 0_i1) cycle
              u(motion%slots(i), c) = motion%start(i, c) + motion%amplitude(c)*path
              if (present(v)) v(motion%slots(i), c) = motion%amplitude(c)*factor
            end do
          case default
            continue  ! a free component
          end select
        end do
      end associate
    end do
  end subroutine impose

end module pd_motion_conditions

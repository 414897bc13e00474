!> Boundary conditions (7.8; doc/theory.md, 10): imposed motion of points and external loads.
module pd_motion_conditions
  use pd_base_kinds, only: wp, i1, i4
  use pd_motion_curve, only: curve_type
  implicit none (type, external)
  private
  public :: motion_type, load_type, free_component, moved_by_displacement, moved_by_velocity
  public :: impose, remember_start

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

  !> External force density on some slots.
  type :: load_type
    integer(i4), allocatable :: slots(:)
    real(wp), allocatable :: density(:, :)  !! at factor 1 (slot, dim) [N/m3]
    type(curve_type) :: curve
  end type load_type

contains

  !> Keep the displacements at t = 0, from which imposed velocities integrate.
  pure subroutine remember_start(motions, u)
    type(motion_type), intent(inout) :: motions(:)
    real(wp), intent(in) :: u(:, :)
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
    type(motion_type), intent(in) :: motions(:)
    real(wp), intent(in) :: t
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

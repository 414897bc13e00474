!> The forces that boundaries exert on single points.
module pd_motion_reactions
  use pd_base_kinds, only: wp, i1
  use pd_motion_conditions, only: accelerations_of, free_component
  use pd_motion_system, only: add_loads, inverse_density, system_type
  implicit none (type, external)
  private
  public :: point_reactions

contains

  !> The force on each point that holds its constrained components to their motion,
  !> V (rho a - f - b) (doc/theory.md, 10), 0 for free ones. Over the points of a boundary it sums
  !> to the reaction of that.
  subroutine point_reactions(system, reaction)
    type(system_type), intent(in) :: system   !! with forces that are up to date
    real(wp), intent(out) :: reaction(:, :)   !! (n_slots, dim) [N]
    real(wp), allocatable :: applied(:, :), acceleration(:)
    integer :: m, c, i, k

    reaction = 0.0_wp
    allocate (applied(size(reaction, 1), size(reaction, 2)), source=0.0_wp)
    if (system%loaded_and_held) call add_loads(system, system%time, 1.0_wp, .false., applied)
    do m = 1, size(system%motions)
      associate (motion => system%motions(m))
        allocate (acceleration(size(motion%slots)))
        do c = 1, system%body%dim
          if (motion%kind(c) == free_component) cycle
          acceleration = 0.0_wp
          if (.not. system%static) call accelerations_of(motion, c, system%time, acceleration)
          do i = 1, size(motion%slots)
            if (motion%held(i, c) == 0_i1) cycle
            k = motion%slots(i)
            reaction(k, c) = system%body%volume(k)*(acceleration(i) &
              & /inverse_density(system%model, k) - system%state%force(k, c) - applied(k, c))
          end do
        end do
        deallocate (acceleration)
      end associate
    end do
  end subroutine point_reactions

end module pd_motion_reactions

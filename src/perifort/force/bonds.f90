!> The bonds as a term of the force: the first of a system's list (`pd_force_terms`).
!>
!> They differ from all other terms in two ways. The passes over the bonds set the values of all
!> slots, so that nothing may be added before them; and bonds break between the two parts of an
!> evaluation. Whoever wants them asks for a part by `bonds` of the view; without that a list is the
!> sum of its other terms.
module pd_force_bonds
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp
  use pd_body_body, only: start_halo
  use pd_force_bound, only: stiffness_bound
  use pd_force_forces, only: after_marks, arriving_force, energy_pass, internal_force
  use pd_force_tangent, only: tangent_product
  use pd_force_term, only: force_term_type, has_tangent, term_view_type
  implicit none (type, external)
  private
  public :: bond_term_type, new_bond_term

  !> It holds nothing: family, model, room of the loops and marks are those of the view. What bonds
  !> carry from one instant to the next (which are broken, damage, histories of laws) is kept with
  !> the system, and what they dissipate is counted where they break.
  type, extends(force_term_type) :: bond_term_type
  contains
    procedure :: add_force => set_force
    procedure :: add_energy => set_energy
    procedure :: add_stiffness_bound => set_bound
    procedure :: add_tangent => set_tangent
    procedure :: keep => keep_nothing
    procedure :: describe => describe_nothing
  end type bond_term_type

contains

  !> The term of a system's bonds.
  function new_bond_term() result(term)
    type(bond_term_type) :: term

    term%name = 'bonds'
    term%sets = .true.
    term%summed_apart = .true.
    term%tangent = has_tangent
  end function new_bond_term

  !> The bonds' force density, or a part of its evaluation (`pd_force_forces`). Displacements of
  !> copies come from their owners, except where they have come for an earlier part.
  subroutine set_force(self, view, force)
    class(bond_term_type), intent(in) :: self           !! the term
    type(term_view_type), intent(in) :: view            !! with what the passes read and write
    real(wp), intent(inout), contiguous :: force(:, :)  !! (n_slots, dim) force density, set [N/m3]

    call must_be_asked(self, view)
    if (associated(view%body%order%ranks) .and. view%bonds%part /= after_marks) then
      call start_halo(view%body, view%u)
      call arriving_force(view%body, view%family, view%bonds%model, view%bonds%options, &
        & view%bonds%workspace, view%u, view%bonds%p, force, view%bonds%strained, &
        & view%bonds%part, view%bonds%of_copies)
    else
      call internal_force(view%body, view%family, view%bonds%model, view%bonds%options, &
        & view%bonds%workspace, view%u, view%bonds%p, force, view%bonds%strained, &
        & view%bonds%part, view%bonds%of_copies)
    end if
  end subroutine set_force

  !> The bonds' strain energy density.
  subroutine set_energy(self, view, density)
    class(bond_term_type), intent(in) :: self          !! the term
    type(term_view_type), intent(in) :: view           !! with what the pass reads and writes
    real(wp), intent(inout), contiguous :: density(:)  !! (n_slots) energy density, set [J/m3]

    call must_be_asked(self, view)
    call energy_pass(view%family, view%bonds%model, view%bonds%workspace, view%u, density)
  end subroutine set_energy

  !> The bound of the bonds' stiffness: a row sums up to twice the M of 7.25.
  subroutine set_bound(self, view, bound)
    class(bond_term_type), intent(in) :: self        !! the term
    type(term_view_type), intent(in) :: view         !! with family, model and room of the loops
    real(wp), intent(inout), contiguous :: bound(:)  !! (n_slots) bound of the stiffness, set [N/m4]

    call must_be_asked(self, view)
    call stiffness_bound(view%body, view%family, view%bonds%model, view%bonds%workspace, bound)
    bound = 2*bound
  end subroutine set_bound

  !> What the bonds resist, by the difference that the view asks for.
  subroutine set_tangent(self, view, w, kw)
    class(bond_term_type), intent(in) :: self        !! the term
    type(term_view_type), intent(in) :: view         !! with the tangent's kind and room
    real(wp), intent(in), contiguous :: w(:, :)      !! (n_slots, dim) small displacement [m]
    real(wp), intent(inout), contiguous :: kw(:, :)  !! (n_slots, dim) resistance to it, set [N/m3]

    call must_be_asked(self, view)
    if (.not. associated(view%bonds%tangent)) call internal_fault('a tangent of no kind')
    call tangent_product(view%body, view%family, view%bonds%model, view%bonds%workspace, &
      & view%bonds%tangent, view%u, w, kw)
  end subroutine set_tangent

  !> There is nothing to keep.
  subroutine keep_nothing(self, archive)
    class(bond_term_type), intent(inout) :: self   !! the term
    class(archive_type), intent(inout) :: archive  !! left as it is

    if (allocated(archive%error) .or. self%sets) return
    call internal_fault('bonds that do not come first')
  end subroutine keep_nothing

  !> Bonds have no line among the terms: materials and horizons have lines of their own.
  function describe_nothing(self) result(text)
    class(bond_term_type), intent(in) :: self  !! the term
    character(:), allocatable :: text

    text = ''
    if (.not. self%sets) call internal_fault('bonds that do not come first')
  end function describe_nothing

  !> A list does not call the bonds where a view has nothing of them.
  subroutine must_be_asked(self, view)
    class(bond_term_type), intent(in) :: self
    type(term_view_type), intent(in) :: view

    if (.not. (self%sets .and. view%bonds%asked)) &
      & call internal_fault('bonds that are not asked for')
  end subroutine must_be_asked

end module pd_force_bonds

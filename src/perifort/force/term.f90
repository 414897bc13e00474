!> Terms of the force: what acts on the points. The bonds are the first one, loads are terms, and so
!> is whatever a program adds that uses the library: springs to the ground, dashpots, contact,
!> gravity between bodies.
!>
!> A term extends `force_term_type` and says what force density it adds, what energy it stores, how
!> stiff it is at most, what it has to keep for a restart, and what it is, in a line. It sees the
!> body through a `term_view_type`. That is all: the loops over time, the time step, the energy
!> balance, checkpoints and the solvers of static equilibrium work on the list of terms alone
!> (`pd_force_terms`).
!>
!> The same bits on any number of threads: a term that computes in parallel lets each slot sum what
!> is its own, in a fixed order.
module pd_force_term
  use pd_base_archive, only: archive_type
  use pd_base_error, only: internal_fault
  use pd_base_kinds, only: wp, i1, i4, i8
  use pd_body_body, only: body_type
  use pd_law_material, only: material_type
  use pd_family_family, only: family_type
  use pd_force_forces, only: whole
  use pd_force_model, only: force_options_type, model_type
  use pd_force_obstacle, only: obstacle_type
  use pd_force_tangent, only: tangent_type
  use pd_force_workspace, only: workspace_type
  implicit none (type, external)
  private
  public :: force_term_type, term_view_type, bonds_view_type, density_of, name_of
  public :: no_tangent, has_tangent, no_stiffness

  !> How the force of a term depends on displacements: somehow, and the term can't say how; with the
  !> tangent that `add_tangent` gives; not at all, as a load that depends on time alone, or a
  !> dashpot. Static equilibrium is not computed with terms of the first kind.
  integer, parameter :: no_tangent = 0, has_tangent = 1, no_stiffness = 2

  !> What is asked of the bonds, and what their passes read and write. No other term looks at it.
  type :: bonds_view_type
    logical :: asked = .false.          !! else a list leaves them out
    type(model_type), pointer :: model => null()          !! parameters of the slots
    type(workspace_type), pointer :: workspace => null()  !! room of the passes
    type(force_options_type) :: options                   !! what the forces take in
    real(wp), pointer, contiguous :: p(:) => null()       !! 2 a d delta theta (n_slots)
    integer(i1), pointer, contiguous :: strained(:) => null()  !! marks (n_slots)
    integer :: part = whole             !! of an evaluation (`pd_force_forces`)
    logical :: of_copies = .true.       !! the forces of copies of other processes' points, too
    type(tangent_type), pointer :: tangent => null()      !! how a product is formed
  end type bonds_view_type

  !> What a term sees. Nothing of it is the term's to change. Arrays are over slots; dead slots
  !> (`body%point` is 0) have no volume and stay zero.
  type :: term_view_type
    type(body_type), pointer :: body => null()      !! positions, volumes, numbers of materials
    class(family_type), pointer :: family => null() !! `bonds_of` lists the bonds of a slot
    type(material_type), pointer, contiguous :: materials(:) => null()
    real(wp), pointer, contiguous :: u(:, :) => null()  !! displacements (n_slots, dim) [m]
    real(wp), pointer, contiguous :: v(:, :) => null()  !! velocities (n_slots, dim) [m/s], as the
                                                    !! integrator keeps them: forward_backward and
                                                    !! velocity_verlet half a step before `time`;
                                                    !! 0 in static equilibrium
    type(obstacle_type), pointer :: obstacles(:) => null()
                                                    !! surfaces of rigid bodies
    real(wp) :: time = 0.0_wp                       !! of the displacements [s]
    integer :: step = 0                             !! complete steps (iterations) then
    integer(i8) :: broken = 0_i8                    !! bonds that have broken until then
    type(bonds_view_type) :: bonds                  !! what is asked of the term of the bonds
  end type term_view_type

  type, abstract :: force_term_type
    character(:), allocatable :: name    !! by which messages speak of it
    logical :: external = .false.        !! its work is that of an external force, and the internal
                                         !! force density does not contain it
    logical :: conservative = .true.     !! internal terms: the force is minus the gradient of the
                                         !! energy; what others do not store counts as dissipated
    integer :: tangent = no_tangent      !! `no_tangent`, `has_tangent` or `no_stiffness`
    logical :: sets = .false.            !! it sets all slots instead of adding to them: the first
                                         !! of its list
    logical :: summed_apart = .false.    !! whoever holds it sums the work of its few points
    logical :: has_partner = .false.     !! it acts between points and what is no point
    logical :: acts_on_few = .false.     !! `acting` tells on which points, internal terms alone
  contains
    procedure(add_force_interface), deferred :: add_force
    procedure(add_energy_interface), deferred :: add_energy
    procedure(add_bound_interface), deferred :: add_stiffness_bound
    procedure(keep_interface), deferred :: keep
    procedure(describe_interface), deferred :: describe
    procedure :: add_damping_bound => no_damping
    procedure :: add_tangent => no_change
    procedure :: begin => begin_nothing
    procedure :: advance => begin_nothing
    procedure :: search => search_nothing
    procedure :: acting => acts_on_all
    procedure :: subtract_partner => no_partner
  end type force_term_type

  abstract interface
    !> Add the term's force density [N/m3] to `force` (n_slots, dim). It may be called several times
    !> in a step and at displacements that are only tried.
    subroutine add_force_interface(self, view, force)
      import :: force_term_type, term_view_type, wp
      implicit none (type, external)
      class(force_term_type), intent(in) :: self  !! the term
      type(term_view_type), intent(in) :: view    !! the instant
      real(wp), intent(inout), contiguous :: force(:, :)
        !! (n_slots, dim) force density, added to [N/m3]
    end subroutine add_force_interface

    !> Add the energy density that the term stores [J/m3] to `density` (n_slots).
    subroutine add_energy_interface(self, view, density)
      import :: force_term_type, term_view_type, wp
      implicit none (type, external)
      class(force_term_type), intent(in) :: self  !! the term
      type(term_view_type), intent(in) :: view    !! the instant
      real(wp), intent(inout), contiguous :: density(:)
        !! (n_slots) energy density, added to [J/m3]
    end subroutine add_energy_interface

    !> Add a bound of the term's stiffness [N/m4] to `bound` (n_slots): for each slot the largest
    !> sum, over its components, of the absolute values of one row of minus the derivative of the
    !> force density with respect to all displacements, in any state the term may get into. A spring
    !> of s [N/m4] to the ground adds s; a bond of that stiffness to another point adds 2 s. The
    !> time step and the mass of relaxation come from it.
    subroutine add_bound_interface(self, view, bound)
      import :: force_term_type, term_view_type, wp
      implicit none (type, external)
      class(force_term_type), intent(in) :: self  !! the term
      type(term_view_type), intent(in) :: view    !! the instant
      real(wp), intent(inout), contiguous :: bound(:)
        !! (n_slots) bound of the stiffness, added to [N/m4]
    end subroutine add_bound_interface

    !> Keep what the term carries from one instant to the next, or put it back: by the same calls of
    !> `archive%keep`.
    subroutine keep_interface(self, archive)
      import :: archive_type, force_term_type
      implicit none (type, external)
      class(force_term_type), intent(inout) :: self  !! its history is set where the archive reads
      class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read
    end subroutine keep_interface

    !> What the term is, in a line of the summary; '' for no line.
    function describe_interface(self) result(text)
      import :: force_term_type
      implicit none (type, external)
      class(force_term_type), intent(in) :: self  !! the term
      character(:), allocatable :: text
    end function describe_interface
  end interface

contains

  !> The density of a point [kg/m3].
  pure real(wp) function density_of(view, k) result(density)
    type(term_view_type), intent(in) :: view   !! of the body
    integer, intent(in) :: k                   !! slot
    density = view%materials(view%body%material(k))%density
  end function density_of

  ! ---------------------------------------------------------------- a term, if it says no more

  !> Add a bound of the damping [N s/m4] to `bound` (n_slots), as that of the stiffness: of the
  !> derivative with respect to velocities. By default there is none.
  subroutine no_damping(self, view, bound)
    class(force_term_type), intent(in) :: self  !! the term
    type(term_view_type), intent(in) :: view    !! the instant
    real(wp), intent(inout), contiguous :: bound(:)
      !! (n_slots) bound of the damping, added to [N s/m4]

    if (.not. (associated(view%u) .and. size(bound) > 0)) call misused(self)
  end subroutine no_damping

  !> Add to `kw` what the term resists to a small displacement `w` [m], minus the derivative of its
  !> force density in that direction [N/m3], both (n_slots, dim). It must be symmetric in the inner
  !> product weighted with volumes. A term that `has_tangent` has a procedure of its own.
  subroutine no_change(self, view, w, kw)
    class(force_term_type), intent(in) :: self   !! the term
    type(term_view_type), intent(in) :: view     !! the instant
    real(wp), intent(in), contiguous :: w(:, :)  !! (n_slots, dim) small displacement [m]
    real(wp), intent(inout), contiguous :: kw(:, :)
      !! (n_slots, dim) resistance to it, added to [N/m3]

    if (self%tangent /= no_stiffness .or. size(w) /= size(kw) .or. .not. associated(view%u)) &
      & call misused(self)
  end subroutine no_change

  !> `begin`: called once when the body is ready at the start. `advance`: called once for each
  !> complete step, at a settled state of static equilibrium too, when its forces are known: the
  !> place to bring a history up to date. By default there is nothing to do.
  subroutine begin_nothing(self, view)
    class(force_term_type), intent(inout) :: self
      !! the term, with its history up to date on return
    type(term_view_type), intent(in) :: view  !! the instant

    if (.not. associated(view%u)) call misused(self)
  end subroutine begin_nothing

  !> Called whenever displacements are new, before forces are asked for: the place to find out what
  !> is near. It changes no force: a term that was not asked finds the same in a slower way. By
  !> default there is nothing to search.
  subroutine search_nothing(self, view, before)
    class(force_term_type), intent(inout) :: self  !! the term
    type(term_view_type), intent(in) :: view       !! the instant
    class(force_term_type), intent(in), optional :: before
      !! the term that stands before it in a list, which has searched

    if (.not. associated(view%u)) call misused(self)
    if (present(before)) then
      if (before%external .and. self%acts_on_few) call misused(self)
    end if
  end subroutine search_nothing

  !> The slots on which the term may act at an instant, in the order of their points: nowhere else
  !> does it make forces or store energy. For a term that `acts_on_few`, which has a procedure of
  !> its own.
  subroutine acts_on_all(self, view, slots)
    class(force_term_type), intent(in) :: self       !! the term
    type(term_view_type), intent(in) :: view         !! the instant
    integer(i4), allocatable, intent(out) :: slots(:)

    if (self%acts_on_few) call misused(self)
    slots = view%body%slot
  end subroutine acts_on_all

  !> Take from displacements since the last instant those of what the points push against, for a
  !> term that `has_partner`: the rest is what its force does work on without the work on the
  !> partner. A term that has one has a procedure of its own.
  subroutine no_partner(self, view, slots, moved)
    class(force_term_type), intent(in) :: self  !! the term
    type(term_view_type), intent(in) :: view    !! the instant
    integer(i4), intent(in) :: slots(:)         !! of some points
    real(wp), intent(inout) :: moved(:, :)      !! (slots, dim) by how much they have moved [m]

    if (size(moved, 1) /= size(slots) .or. .not. associated(view%u) .or. self%has_partner) &
      & call misused(self)
  end subroutine no_partner

  !> A call that contradicts what a term says of itself.
  subroutine misused(self)
    class(force_term_type), intent(in) :: self
    call internal_fault('the force term '//name_of(self)//' was asked for what it does not have')
  end subroutine misused

  !> The term's name, or that it has none.
  function name_of(term) result(name)
    class(force_term_type), intent(in) :: term
    character(:), allocatable :: name

    name = 'without a name'
    if (allocated(term%name)) name = '"'//term%name//'"'
  end function name_of

end module pd_force_term
